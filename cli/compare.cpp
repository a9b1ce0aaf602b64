// lightloom compare: how far one irradiance image is from another.
#include <nlohmann/json.hpp>

#include <cstdio>
#include <memory>

#include "cli/command.h"
#include "cli/files.h"
#include "cli/print_json.h"
#include "core/reference/compare.h"

namespace lightloom {
namespace {

struct Options {
  std::string a, b, difference;
  int block = 1;
  float scale_b = 1, gain = 8;
  bool json = false;
};

absl::Status check(const Options& o) {
  if (o.block < 1 || o.block > 16384) return absl::InvalidArgumentError("--block must be 1 to 16384");
  if (!(o.scale_b > 0)) return absl::InvalidArgumentError("--scale-b must be above 0");
  if (!(o.gain > 0)) return absl::InvalidArgumentError("--gain must be above 0");
  LL_RETURN_IF_ERROR(check_input(o.a));
  LL_RETURN_IF_ERROR(check_input(o.b));
  if (o.difference.empty()) return absl::OkStatus();
  return OutputCheck({o.a, o.b}).file("--difference", o.difference, {".png"});
}

absl::Status run(const Options& o) {
  LL_ASSIGN_OR_RETURN(const Image a, read_exr(o.a));
  LL_ASSIGN_OR_RETURN(const Image b, read_exr(o.b));
  const CompareOptions options{o.block, o.scale_b};
  LL_ASSIGN_OR_RETURN(const Comparison c, compare(a, b, options));
  if (!o.difference.empty()) LL_RETURN_IF_ERROR(write_png(difference_image(a, b, options, o.gain), o.difference));
  if (o.json) {
    print_json({{"rel_rmse", c.rel_rmse},
                {"bias", c.bias},
                {"psnr", c.psnr},
                {"p50", c.p50},
                {"p95", c.p95},
                {"p99", c.p99},
                {"ratio", c.ratio},
                {"ratio_error", c.ratio_error},
                {"texels", c.texels}});
  } else {
    std::printf(
        "rel_rmse %.5f  bias %+.5f  psnr %.2f dB  p50 %.5f  p95 %.5f  p99 %.5f  ratio %.5f ± %.5f  texels %llu\n",
        c.rel_rmse, c.bias, c.psnr, c.p50, c.p95, c.p99, c.ratio, c.ratio_error,
        static_cast<unsigned long long>(c.texels));
  }
  return absl::OkStatus();
}

}  // namespace

Command compare_command() {
  const auto o = std::make_shared<Options>();
  return {"compare",
          "Measure how far image A is from image B, the truth",
          {{"A", "EXR", &o->a, true},
           {"B", "EXR, the truth", &o->b, true},
           {"--block", "average over N×N texels first", &o->block},
           {"--scale-b", "factor on B", &o->scale_b},
           {"--difference", "PNG of the absolute difference to write, per block", &o->difference},
           {"--gain", "of the difference image", &o->gain},
           {"--json", "print the result as JSON", &o->json}},
          [o] { return check(*o); },
          [o] { return run(*o); }};
}

}  // namespace lightloom
