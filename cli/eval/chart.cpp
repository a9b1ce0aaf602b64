#include "cli/eval/chart.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "cli/eval/pareto.h"

namespace lightloom::eval {
namespace {

// Okabe & Ito's colours, which the colour-blind can tell apart; marks differ too.
constexpr const char* kColours[] = {"#0072B2", "#56B4E9", "#D55E00", "#009E73", "#CC79A7", "#7a7a7a", "#E69F00"};
constexpr double kWidth = 720, kHeight = 458, kLeft = 68, kRight = 16, kTop = 34, kBottom = 102;

std::string number(double v) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f", v);
  return text;
}

/// 0.05, 20, 3k, 2M.
std::string tick(double v) {
  const char* unit = "";
  if (v >= 1e9) {
    v /= 1e9, unit = "G";
  } else if (v >= 1e6) {
    v /= 1e6, unit = "M";
  } else if (v >= 1e4) {
    v /= 1e3, unit = "k";
  }
  char text[32];
  std::snprintf(text, sizeof text, "%.3g%s", v, unit);
  return text;
}

class Axis {
 public:
  Axis(double from, double to) : from_(from), to_(to) {}
  void include(double v) {
    lo_ = empty_ ? v : std::min(lo_, v);
    hi_ = empty_ ? v : std::max(hi_, v);
    empty_ = false;
  }
  void finish() {
    if (empty_) lo_ = hi_ = 1;
    lo_ /= 1.15, hi_ *= 1.15;
    if (hi_ < 2 * lo_) lo_ /= 1.3, hi_ *= 1.3;
  }
  double at(double v) const { return from_ + (to_ - from_) * std::log(v / lo_) / std::log(hi_ / lo_); }
  /// 1, 2, 5 within one and a half decades, 1, 3 within three, powers of ten beyond.
  std::vector<double> ticks() const {
    const double decades = std::log10(hi_ / lo_);
    const std::vector<double> steps = decades <= 1.5 ? std::vector<double>{1, 1.5, 2, 3, 5, 7}
                                      : decades <= 3 ? std::vector<double>{1, 2, 5}
                                                     : std::vector<double>{1};
    std::vector<double> out;
    for (int p = static_cast<int>(std::floor(std::log10(lo_))); p <= std::ceil(std::log10(hi_)); ++p) {
      for (const double s : steps) {
        const double v = s * std::pow(10.0, p);
        if (v >= lo_ && v <= hi_) out.push_back(v);
      }
    }
    return out;
  }

 private:
  double from_, to_;
  double lo_ = 1, hi_ = 1;
  bool empty_ = true;
};

std::string mark(size_t series, double x, double y, bool filled, const std::string& words) {
  const std::string colour = kColours[series % std::size(kColours)];
  const std::string style =
      "fill=\"" + (filled ? colour : std::string("#fff")) + "\" stroke=\"" + colour + "\" stroke-width=\"1.6\"";
  const auto path = [&](std::initializer_list<std::pair<double, double>> corners) {
    std::string d;
    for (const auto& [dx, dy] : corners) d += (d.empty() ? "M" : "L") + number(x + dx) + " " + number(y + dy);
    return "<path d=\"" + d + "Z\" " + style + ">";
  };
  std::string shape;
  std::string end = "</path>";
  switch (series % 5) {
    case 0:
      shape = "<circle cx=\"" + number(x) + "\" cy=\"" + number(y) + "\" r=\"4.5\" " + style + ">";
      end = "</circle>";
      break;
    case 1:
      shape = path({{-4, -4}, {4, -4}, {4, 4}, {-4, 4}});
      break;
    case 2:
      shape = path({{0, -5.2}, {5, 4}, {-5, 4}});
      break;
    case 3:
      shape = path({{0, -5.6}, {5.2, 0}, {0, 5.6}, {-5.2, 0}});
      break;
    default:
      shape = path({{-5, -4}, {5, -4}, {0, 5.2}});
      break;
  }
  return shape + "<title>" + escape_markup(words) + "</title>" + end;
}

/// Many marks at once: lines of no length with round ends.
std::string dots(size_t series, const std::string& path) {
  return "<path d=\"" + path + "\" fill=\"none\" stroke=\"" + kColours[series % std::size(kColours)] +
         "\" stroke-width=\"4\" stroke-linecap=\"round\" stroke-opacity=\"0.45\"/>\n";
}

std::string text(double x, double y, const std::string& words, const std::string& more = "") {
  return "<text x=\"" + number(x) + "\" y=\"" + number(y) + "\" " + more + ">" + escape_markup(words) + "</text>\n";
}

}  // namespace

std::string escape_markup(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
    }
  }
  return out;
}

std::string chart_svg(const Chart& chart) {
  const auto shown = [](const ChartPoint& p) { return p.x > 0 && p.y > 0 && std::isfinite(p.x) && std::isfinite(p.y); };
  Axis x(kLeft, kWidth - kRight), y(kHeight - kBottom, kTop);
  for (const ChartSeries& s : chart.series) {
    for (const ChartPoint& p : s.points) {
      if (!shown(p)) continue;
      x.include(p.x);
      y.include(p.y);
    }
  }
  x.finish();
  y.finish();

  std::string out = "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 " + number(kWidth) + " " +
                    number(kHeight) +
                    "\" font-family=\"system-ui, sans-serif\" font-size=\"12\" role=\"img\" aria-label=\"" +
                    escape_markup(chart.title) + "\">\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n";
  out += text(kLeft, 18, chart.title, "font-size=\"14\" font-weight=\"600\"");
  for (const double v : x.ticks()) {
    out += "<line x1=\"" + number(x.at(v)) + "\" x2=\"" + number(x.at(v)) + "\" y1=\"" + number(kTop) + "\" y2=\"" +
           number(kHeight - kBottom) + "\" stroke=\"#e4e4e4\"/>\n";
    out += text(x.at(v), kHeight - kBottom + 16, tick(v), "text-anchor=\"middle\" fill=\"#444\"");
  }
  for (const double v : y.ticks()) {
    out += "<line x1=\"" + number(kLeft) + "\" x2=\"" + number(kWidth - kRight) + "\" y1=\"" + number(y.at(v)) +
           "\" y2=\"" + number(y.at(v)) + "\" stroke=\"#e4e4e4\"/>\n";
    out += text(kLeft - 6, y.at(v) + 4, tick(v), "text-anchor=\"end\" fill=\"#444\"");
  }
  out += text((kLeft + kWidth - kRight) / 2, kHeight - kBottom + 34, chart.x_title, "text-anchor=\"middle\"");
  out += "<text transform=\"translate(14 " + number((kTop + kHeight - kBottom) / 2) +
         ") rotate(-90)\" text-anchor=\"middle\">" + escape_markup(chart.y_title) + "</text>\n";

  // The front: a line behind all marks, which are full on it and hollow off it.
  std::vector<Cost> costs;
  std::vector<std::pair<size_t, size_t>> where;
  for (size_t s = 0; s < chart.series.size(); ++s) {
    for (size_t p = 0; p < chart.series[s].points.size(); ++p) {
      const ChartPoint& point = chart.series[s].points[p];
      if (chart.scatter || chart.series[s].joined || !shown(point)) continue;
      costs.push_back({point.x, point.y});
      where.emplace_back(s, p);
    }
  }
  std::vector<std::vector<bool>> best(chart.series.size());
  for (size_t s = 0; s < best.size(); ++s) best[s].resize(chart.series[s].points.size());
  std::string line;
  for (const size_t i : pareto_front(costs)) {
    best[where[i].first][where[i].second] = true;
    line += (line.empty() ? "M" : "L") + number(x.at(costs[i].x)) + " " + number(y.at(costs[i].error));
  }
  if (!line.empty()) {
    out += "<path d=\"" + line + "\" fill=\"none\" stroke=\"#bbb\" stroke-width=\"5\" stroke-linejoin=\"round\"/>\n";
  }
  const auto style = [&](size_t s) { return chart.scatter ? 2 * s : s; };  // two series, of unlike colours
  for (size_t i = chart.series.size(); i-- > 0;) {                         // ours last, on top; lines over dots
    const size_t s = chart.scatter ? chart.series.size() - 1 - i : i;
    std::string joined, scattered;
    for (size_t p = 0; p < chart.series[s].points.size(); ++p) {
      const ChartPoint& point = chart.series[s].points[p];
      if (!shown(point)) continue;
      const double px = x.at(point.x), py = y.at(point.y);
      if (chart.series[s].joined) joined += (joined.empty() ? "M" : "L") + number(px) + " " + number(py);
      if (chart.scatter && !chart.series[s].joined) {
        scattered += "M" + number(px) + " " + number(py) + "h0";
        continue;
      }
      if (point.is_default) {
        out += "<circle cx=\"" + number(px) + "\" cy=\"" + number(py) + "\" r=\"9\" fill=\"none\" stroke=\"#222\"/>\n";
      }
      out += mark(style(s), px, py, best[s][p] || chart.series[s].joined, chart.series[s].title + ", " + point.words) +
             "\n";
    }
    if (!scattered.empty()) out += dots(style(s), scattered);
    if (!joined.empty()) {
      out += "<path d=\"" + joined + "\" fill=\"none\" stroke=\"" + kColours[style(s) % std::size(kColours)] +
             "\" stroke-dasharray=\"4 3\"/>\n";
    }
  }
  double left = kLeft, row = kHeight - 46;
  for (size_t s = 0; s < chart.series.size(); ++s) {
    const double wide = 34 + 6.6 * static_cast<double>(chart.series[s].title.size());
    if (left + wide > kWidth && left > kLeft) left = kLeft, row += 18;
    out += mark(style(s), left + 6, row, true, chart.series[s].title);
    out += text(left + 16, row + 4, chart.series[s].title);
    left += wide;
  }
  if (!chart.scatter) {
    out +=
        text(kLeft, kHeight - 6,
             "Grey line: Pareto front. Full marks lie on it. Circled: a method's default. Dashed: measured elsewhere.",
             "font-size=\"10.5\" fill=\"#666\"");
  }
  return out + "</svg>\n";
}

}  // namespace lightloom::eval
