#include "cli/eval/pictures.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "cli/interrupt.h"
#include "core/base/sampling.h"
#include "core/relight/camera_view.h"
#include "core/relight/lightmap.h"
#include "core/scene/srgb.h"

namespace lightloom::eval {
namespace {

constexpr int kWidth = 480;
constexpr int kCropShare = 4;  // a crop is this part of a picture's width, as wide as the picture when shown

/// E of the elements' front sides from a lightmap; 0 for backs, of which lightmaps know nothing.
std::vector<Vec3> from_lightmap(const SurfaceElements& elements, const Image& lightmap) {
  std::vector<Vec3> e(elements.receivers.all.size());
  for (size_t i = 0; i < e.size(); ++i) {
    const Receiver& r = elements.receivers.all[i];
    if (r.back) continue;
    const auto [x, y] = pixel_of(elements, r);
    e[i] = lightmap.rgb(x, y);
  }
  return e;
}

/// An image of the elements' values as the reader sees it: through a camera, or as the lightmap lies.
class Viewer {
 public:
  Viewer(LitLevel* level) : level_(*level) {}

  absl::StatusOr<Image> view(const std::vector<Vec3>& values) const {
    if (level_.scene().cameras.empty()) return lightmap_image(level_.elements(), values);
    ViewOptions options;
    options.width = kWidth;
    options.layer = Layer::kE;
    options.parallel = level_.bar()->parallel("pictures", level_.threads());
    auto image = render_view(level_.tracer(), level_.elements(), values, level_.scene().cameras.front(), options);
    LL_RETURN_IF_ERROR(not_interrupted());
    return image;
  }

 private:
  LitLevel& level_;
};

/// |ΔE| over channels.
std::vector<Vec3> difference(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  std::vector<Vec3> out(a.size());
  for (size_t i = 0; i < a.size(); ++i) {
    const Vec3 d = a[i] - b[i];
    const float error = std::sqrt(dot(d, d) / 3);
    out[i] = {error, error, error};
  }
  return out;
}

/// Mean of what is lit in the picture, over channels: errors are shown relative to it, as most of a level may lie in the dark.
float mean_in_view(const Image& view) {
  double sum = 0, lit = 0;
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) {
      const Vec3 v = view.rgb(x, y);
      const double mean = static_cast<double>(v.x + v.y + v.z) / 3;
      if (mean > 0) sum += mean, ++lit;
    }
  }
  return static_cast<float>(lit > 0 ? sum / lit : 1);
}

Image heat_map(const Image& error, float unit) {
  Image out(error.width, error.height, {"R", "G", "B"});
  for (int y = 0; y < out.height; ++y) {
    for (int x = 0; x < out.width; ++x) out.set_rgb(x, y, heat_colour(error.rgb(x, y).x / unit / kHeatTop));
  }
  return out;
}

struct Window {
  int x = 0, y = 0, side = 1;
};

/// The square of the image in which the error's squares sum up to most.
Window worst_window(const Image& error) {
  Window worst;
  worst.side = std::max(8, std::min(error.width, error.height) / kCropShare);
  double most = -1;
  const int step = std::max(1, worst.side / 4);
  for (int y0 = 0; y0 + worst.side <= error.height; y0 += step) {
    for (int x0 = 0; x0 + worst.side <= error.width; x0 += step) {
      double sum = 0;
      for (int y = y0; y < y0 + worst.side; ++y) {
        for (int x = x0; x < x0 + worst.side; ++x) sum += std::pow(static_cast<double>(error.rgb(x, y).x), 2);
      }
      if (sum > most) most = sum, worst.x = x0, worst.y = y0;
    }
  }
  return worst;
}

Image cut(const Image& image, const Window& w) {
  const int zoom = std::max(1, 240 / w.side);
  Image out(w.side * zoom, w.side * zoom, {"R", "G", "B"});
  for (int y = 0; y < out.height; ++y) {
    for (int x = 0; x < out.width; ++x) {
      out.set_rgb(x, y,
                  image.rgb(std::min(image.width - 1, w.x + x / zoom), std::min(image.height - 1, w.y + y / zoom)));
    }
  }
  return out;
}

absl::StatusOr<Sheet> make_sheet(LitLevel* level, const Evaluation& evaluation, const std::string& folder, size_t rig,
                                 const std::string& words) {
  Sheet sheet{evaluation.rigs[rig].name, words, {}};
  const std::string at = folder + "/pictures/" + std::to_string(rig) + "-";
  LL_ASSIGN_OR_RETURN(Image truth_map, read_exr(truth_path(folder, rig)));
  dilate(&truth_map);  // it leaves out what lies in solids
  const std::vector<Vec3> truth = from_lightmap(level->elements(), truth_map);
  const Viewer viewer(level);
  LL_ASSIGN_OR_RETURN(Image truth_view, viewer.view(truth));
  const float unit = mean_in_view(truth_view);
  const float exposure = expose(&truth_view);
  Window window;
  LL_RETURN_IF_ERROR(write_png(truth_view, at + "truth.png"));
  sheet.pictures.push_back({"path traced", at + "truth.png", "", at + "truth-crop.png", ""});
  for (const auto& method : evaluation.methods) {
    LL_ASSIGN_OR_RETURN(const Image lightmap, read_exr(lightmap_path(folder, method.name, rig)));
    const std::vector<Vec3> e = from_lightmap(level->elements(), lightmap);
    LL_ASSIGN_OR_RETURN(Image view, viewer.view(e));
    LL_ASSIGN_OR_RETURN(const Image error, viewer.view(difference(e, truth)));
    const Image heat = heat_map(error, unit);
    expose(&view, exposure);
    if (sheet.pictures.size() == 1) {  // where the first method, ours, is worst
      window = worst_window(error);
      LL_RETURN_IF_ERROR(write_png(cut(truth_view, window), at + "truth-crop.png"));
    }
    const Picture p{method.title, at + method.name + ".png", at + method.name + "-heat.png",
                    at + method.name + "-crop.png", at + method.name + "-crop-heat.png"};
    LL_RETURN_IF_ERROR(write_png(view, p.e));
    LL_RETURN_IF_ERROR(write_png(heat, p.heat));
    LL_RETURN_IF_ERROR(write_png(cut(view, window), p.crop));
    LL_RETURN_IF_ERROR(write_png(cut(heat, window), p.crop_heat));
    sheet.pictures.push_back(p);
  }
  return sheet;
}

}  // namespace

Vec3 heat_colour(float t) {
  // sRGB of Matplotlib's "inferno" (CC0) at equal steps.
  static constexpr Vec3 kStops[] = {{0, 0, 0.016f},           {0.259f, 0.039f, 0.408f}, {0.576f, 0.149f, 0.404f},
                                    {0.867f, 0.318f, 0.227f}, {0.988f, 0.647f, 0.039f}, {0.988f, 1, 0.643f}};
  const float at = std::clamp(t, 0.0f, 1.0f) * (std::size(kStops) - 1);
  const size_t i = std::min(static_cast<size_t>(at), std::size(kStops) - 2);
  const Vec3 c = kStops[i] + (kStops[i + 1] - kStops[i]) * (at - static_cast<float>(i));
  return {static_cast<float>(from_srgb(c.x)), static_cast<float>(from_srgb(c.y)), static_cast<float>(from_srgb(c.z))};
}

absl::StatusOr<std::vector<Sheet>> make_pictures(LitLevel* level, const Evaluation& evaluation,
                                                 const std::string& folder) {
  std::vector<Sheet> sheets;
  if (evaluation.runs.empty()) return sheets;
  const Run& ours = evaluation.runs.front();
  std::vector<size_t> by_error(ours.rigs.size());
  std::iota(by_error.begin(), by_error.end(), size_t{0});
  std::stable_sort(by_error.begin(), by_error.end(),
                   [&](size_t a, size_t b) { return ours.rigs[a].error() < ours.rigs[b].error(); });
  const size_t middle = by_error[by_error.size() / 2], worst = by_error.back();
  const std::string title = evaluation.methods.front().title;
  LL_ASSIGN_OR_RETURN(sheets.emplace_back(),
                      make_sheet(level, evaluation, folder, middle, "the median error of " + title + " over the rigs"));
  if (worst != middle) {
    LL_ASSIGN_OR_RETURN(sheets.emplace_back(),
                        make_sheet(level, evaluation, folder, worst, "the worst of " + title + "'s rigs"));
  }
  return sheets;
}

}  // namespace lightloom::eval
