#include "cli/eval/report.h"

#include <absl/strings/escaping.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_split.h>

#include <cstdio>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "cli/eval/pareto.h"
#include "core/base/file.h"
#include "core/base/text.h"

namespace lightloom::eval {
namespace {

/// What a chart's x axis is, and of which runs it has no value (0).
struct CostAxis {
  const char* name;
  const char* title;
  const char* words;
  double (*of)(const Run&);
};
constexpr CostAxis kAxes[] = {
    {"core-seconds", "Error against processor time", "core-seconds of the bake",
     [](const Run& r) { return r.facts.core_seconds; }},
    {"seconds", "Error against waiting time", "seconds of the bake", [](const Run& r) { return r.facts.seconds; }},
    {"bytes", "Error against size", "bytes stored", [](const Run& r) { return static_cast<double>(r.facts.bytes); }},
    {"frame-ms", "Error against frame time", "milliseconds of a frame in which all light changes (processor)",
     [](const Run& r) { return r.frame(); }},
    {"frame-bytes", "Error against bytes a frame reads", "stored bytes that a frame reads in which all light changes",
     [](const Run& r) { return static_cast<double>(r.facts.frame_bytes); }},
};

std::string format(const char* how, double value) {
  char text[64];
  std::snprintf(text, sizeof text, how, value);
  return text;
}

std::string megabytes(double bytes) { return format(bytes < 1e6 ? "%.3f" : "%.1f", bytes / 1e6); }

std::string words_of(const Run& r) {
  return r.label + ": error " + format("%.4f", r.error()) + ", " + format("%.1f", r.facts.seconds) + " s, " +
         megabytes(static_cast<double>(r.facts.bytes)) + " MB, " + format("%.2f", r.frame()) + " ms";
}

std::string title_of(const Evaluation& e, const std::string& method) {
  for (const auto& m : e.methods) {
    if (m.name == method) return m.title;
  }
  return method;
}

using Row = std::vector<std::string>;

/// Cells are markup. Columns from the `numbers`th on hold numbers.
std::string table(const Row& head, const std::vector<Row>& rows, size_t numbers) {
  std::string out = "<table><thead><tr>";
  const auto cell = [&](const char* tag, size_t column, const std::string& text) {
    out += std::string("<") + tag + (column >= numbers ? " class=\"n\">" : ">") + text + "</" + tag + ">";
  };
  for (size_t i = 0; i < head.size(); ++i) cell("th", i, head[i]);
  out += "</tr></thead><tbody>\n";
  for (const Row& row : rows) {
    out += "<tr>";
    for (size_t i = 0; i < row.size(); ++i) cell("td", i, row[i]);
    out += "</tr>\n";
  }
  return out + "</tbody></table>\n";
}

Row costs_of(const Run& r) {
  const auto or_dash = [](double value, const std::string& text) { return value > 0 ? text : std::string("–"); };
  const double frame_bytes = static_cast<double>(r.facts.frame_bytes);
  return {format("%.4f", r.error()),
          format("%.4f", r.worst()),
          format("%.1f", r.facts.seconds),
          format("%.1f", r.facts.core_seconds),
          megabytes(static_cast<double>(r.facts.bytes)),
          or_dash(r.frame(), format("%.2f", r.frame())),
          or_dash(frame_bytes, megabytes(frame_bytes)),
          or_dash(static_cast<double>(r.facts.probes), std::to_string(r.facts.probes))};
}
const Row kCostTitles = {"error", "worst", "bake, s", "core-s", "MB", "frame, ms", "read a frame, MB", "probes"};

Row joined(Row a, const Row& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

/// Of one method.
std::vector<Cost> front_of(const Evaluation& e, const std::string& method, double (*cost)(const Run&)) {
  std::vector<Cost> all, front;
  for (const Run& r : e.runs) {
    if (r.method == method && cost(r) > 0) all.push_back({cost(r), r.error()});
  }
  for (const size_t i : pareto_front(all)) front.push_back(all[i]);
  return front;
}

double bytes_of(const Run& r) { return static_cast<double>(r.facts.bytes); }
double core_seconds_of(const Run& r) { return r.facts.core_seconds; }

const Row kEqualTitles = {"error in as many bytes", "MB for as small an error", "error in as many core-s",
                          "core-s for as small an error"};
Row row_of(const Equals& equal) {
  const auto say = [](const char* how, std::optional<double> value, double unit = 1) {
    return value ? format(how, *value / unit) : std::string("–");
  };
  return {say("%.4f", equal.error_in_bytes), say("%.3g", equal.bytes_for_error, 1e6),
          say("%.4f", equal.error_in_core_seconds), say("%.3g", equal.core_seconds_for_error)};
}

NamedChart expected_error_chart(const std::string& level, const ExpectedError& expected) {
  ChartSeries receivers{"a receiver", {}, false}, medians{"median of each tenth", {}, true};
  for (size_t i = 0; i < expected.norm.size(); ++i) {
    receivers.points.push_back({expected.norm[i], expected.own_error[i], "", false});
  }
  for (const auto& t : expected.tenths()) {
    medians.points.push_back({t.norm, t.error, format("norm %.3f", t.norm) + format(", error %.4f", t.error), false});
  }
  return {"operator-norm",
          {level + ": error over all light, and under the rigs",
           "operator norm (SL17, Eq. 12), 1: nothing comes through",
           "Σ|ΔE| ÷ ΣE of a receiver, over the rigs",
           true,
           {std::move(receivers), std::move(medians)}}};
}

std::string expected_error_words(const ExpectedError& x) {
  return "<p>Where errors are to be expected, whatever the light: SL17's operator norm (Eq. 12, a receiver's light "
         "projected to its probes and back) of the default settings has, over " +
         std::to_string(x.norm.size()) + " receivers that any rig lights, the <b>rank correlation " +
         format("%.2f", x.own_correlation()) +
         "</b> (Spearman) with the error relative to what the receiver gets over all rigs, and " +
         format("%.2f", x.correlation()) +
         " with |ΔE| relative to the level's mean E, which is larger where the receiver is brighter. The truth's own "
         "noise, which no norm foresees, is " +
         format("%.0f", 100 * x.noise) + " % of the squared error, and lowers both.</p>\n";
}

absl::StatusOr<std::string> picture(const std::string& path, const std::string& words) {
  if (path.empty()) return std::string();
  LL_ASSIGN_OR_RETURN(const auto bytes, read_file(path));
  const std::string encoded = absl::Base64Escape({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  return "<img alt=\"" + escape_markup(words) + "\" src=\"data:image/png;base64," + encoded + "\">";
}

absl::StatusOr<std::string> sheet_markup(const Page& page, const Sheet& sheet) {
  std::string out = "<h3>Rig " + escape_markup(printable(sheet.rig)) + " <small>(" + escape_markup(sheet.words) +
                    ")</small></h3>\n<div class=\"sheet\">\n";
  for (const Picture& p : sheet.pictures) {
    LL_ASSIGN_OR_RETURN(const std::string e, picture(p.e, "E by " + p.title));
    LL_ASSIGN_OR_RETURN(const std::string heat, picture(p.heat, "error of " + p.title));
    LL_ASSIGN_OR_RETURN(const std::string crop, picture(p.crop, "closer"));
    LL_ASSIGN_OR_RETURN(const std::string crop_heat, picture(p.crop_heat, "error, closer"));
    std::string figure;
    for (const auto& m : page.evaluation.methods) {
      if (m.title != p.title) continue;
      for (const RigError& r : default_run(page.evaluation, m.name)->rigs) {
        if (r.rig == sheet.rig)
          figure = ", error " + format("%.4f", r.error()) + ", bias " + format("%+.2f %%", 100 * r.bias);
      }
    }
    out += "<figure><div class=\"pair\">" + e + heat + "</div><div class=\"pair\">" + crop + crop_heat +
           "</div><figcaption><b>" + escape_markup(p.title) + "</b>" + figure + "</figcaption></figure>\n";
  }
  return out + "</div>\n";
}

/// Errors hold on any machine; times do not.
std::string other_machines(const Evaluation& e) {
  std::map<std::string, std::string> runs;
  for (const Run& r : e.runs) {
    for (const std::string& machine : r.machines) {
      std::string& all = runs[machine];
      if (machine != e.machine) all += (all.empty() ? "" : "; ") + title_of(e, r.method) + ", " + r.label;
    }
  }
  std::string out;
  for (const auto& [machine, all] : runs) {
    if (all.empty()) continue;
    out += "<p class=\"bad\"><b>Times taken on another machine</b>, " + escape_markup(printable(machine)) + ": " +
           escape_markup(all) + ".</p>\n";
  }
  return out;
}

std::string rigs_markup(const Evaluation& e) {
  Row head = {"rig", "truth's noise", "paths a texel"};
  for (const auto& m : e.methods) head.push_back(escape_markup(m.title));
  std::vector<Row> rows;
  for (size_t i = 0; i < e.rigs.size(); ++i) {
    Row row = {escape_markup(printable(e.rigs[i].name)), format("%.4f", e.rigs[i].noise),
               std::to_string(e.rigs[i].samples)};
    for (const auto& m : e.methods) {
      const Run* run = default_run(e, m.name);
      row.push_back(run != nullptr && i < run->rigs.size()
                        ? format("%.4f", run->rigs[i].error()) + " <small>" +
                              format("%+.1f %%", 100 * run->rigs[i].bias) + "</small>"
                        : "–");
    }
    rows.push_back(std::move(row));
  }
  return "<h2>Rig by rig</h2>\n" + table(head, rows, 1) +
         "<p><small>Error, and bias Σ(E − E<sub>truth</sub>) ÷ ΣE<sub>truth</sub>.</small></p>\n";
}

/// Of a pool: the errors of each level, and its own charts.
std::string levels_markup(const Evaluation& pooled, const std::vector<Evaluation>& levels) {
  Row head = {"level", "rigs", "receivers", "operator norm's rank correlation"};
  for (const auto& m : pooled.methods) head.push_back(escape_markup(m.title));
  std::vector<Row> rows;
  std::string charts;
  for (const Evaluation& e : levels) {
    Row row = {escape_markup(printable(e.level)), std::to_string(e.rigs.size()), std::to_string(e.receivers),
               e.expected ? format("%.2f", e.expected->own_correlation()) : "–"};
    for (const auto& m : pooled.methods) row.push_back(format("%.4f", default_run(e, m.name)->error()));
    rows.push_back(std::move(row));
    charts += "<h3>" + escape_markup(printable(e.level)) + " <small>" + escape_markup(e.machine) + "</small></h3>\n" +
              other_machines(e) + "<div class=\"charts\">\n";
    for (const NamedChart& c : make_charts(e, nullptr)) charts += chart_svg(c.chart);
    charts += "</div>\n";
  }
  return "<h2>Level by level</h2>\n" + table(head, rows, 1) + charts;
}

std::string css_ramp() {
  std::string stops;
  for (int i = 0; i <= 10; ++i) {
    const Vec3 c = heat_colour(static_cast<float>(i) / 10);
    const auto byte = [](float v) {
      return static_cast<int>(255 * (v <= 0.0031308f ? 12.92f * v : 1.055f * std::pow(v, 1 / 2.4f) - 0.055f) + 0.5f);
    };
    char text[32];
    std::snprintf(text, sizeof text, "%s#%02x%02x%02x", i == 0 ? "" : ",", byte(c.x), byte(c.y), byte(c.z));
    stops += text;
  }
  return stops;
}

constexpr const char* kStyle = R"(<style>
:root{color-scheme:light}
body{font:15px/1.5 system-ui,sans-serif;color:#1b1b1b;background:#fff;max-width:1120px;margin:2rem auto;padding:0 1.2rem}
h1{font-size:1.7rem;margin-bottom:.2rem}h2{font-size:1.25rem;margin-top:2.2rem;border-bottom:1px solid #ddd;padding-bottom:.2rem}
h3{font-size:1.05rem;margin:1.4rem 0 .4rem}small{color:#666;font-weight:400}
table{border-collapse:collapse;font-size:.86rem;margin:.6rem 0}th,td{padding:.2rem .6rem;text-align:left;border-bottom:1px solid #eee;vertical-align:top}
th{border-bottom:1px solid #999;font-weight:600}td.n,th.n{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}
.charts{display:grid;grid-template-columns:repeat(auto-fit,minmax(480px,1fr));gap:1rem}.charts svg{width:100%;height:auto;border:1px solid #eee}
.sheet{display:grid;grid-template-columns:repeat(auto-fit,minmax(340px,1fr));gap:1rem}
figure{margin:0;break-inside:avoid}.pair{display:flex;gap:2px;margin-bottom:2px;background:#f4f4f4}.pair img{width:50%;min-width:0;height:auto;image-rendering:auto}
figcaption{font-size:.85rem}.ramp{display:inline-block;width:160px;height:.8em;vertical-align:middle}
code{font-size:.88em;background:#f5f5f5;padding:.1em .3em}.bad{color:#b00020}
details{margin:.6rem 0}summary{cursor:pointer}
@media print{body{max-width:none;margin:0;font-size:10pt}h2{break-after:avoid}.charts{grid-template-columns:1fr 1fr}tr,svg{break-inside:avoid}details>*{display:block}}
</style>)";

}  // namespace

absl::StatusOr<Curve> read_curve(const std::filesystem::path& path) {
  LL_ASSIGN_OR_RETURN(const auto bytes, read_file(path));
  const auto bad = [&](size_t line) {
    return absl::InvalidArgumentError(path.string() + ", line " + std::to_string(line) +
                                      ": expected core_seconds,error,words with both numbers above 0");
  };
  Curve curve;
  bool named = false;
  size_t number = 0;
  for (absl::string_view line :
       absl::StrSplit(absl::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()), '\n')) {
    ++number;
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    if (line.empty()) continue;
    if (line.front() == '#') {
      const std::string words(line.substr(line.size() > 1 && line[1] == ' ' ? 2 : 1));
      (curve.title.empty() ? curve.title : curve.about) += curve.about.empty() ? words : " " + words;
      continue;
    }
    if (!named) {
      if (line != "core_seconds,error,words") return bad(number);
      named = true;
      continue;
    }
    const std::vector<std::string> fields = absl::StrSplit(line, absl::MaxSplits(',', 2));
    ChartPoint point;
    if (fields.size() != 3 || !absl::SimpleAtod(fields[0], &point.x) || !absl::SimpleAtod(fields[1], &point.y) ||
        !(point.x > 0) || !(point.y > 0)) {
      return bad(number);
    }
    point.words = fields[2];
    curve.points.push_back(point);
  }
  if (curve.title.empty()) curve.title = path.stem().string();
  return curve;
}

std::vector<NamedChart> make_charts(const Evaluation& e, const Curve* curve) {
  std::vector<NamedChart> charts;
  for (const CostAxis& axis : kAxes) {
    const bool pooled = !e.pooled.empty();
    const double unit = pooled ? axis.of(e.runs.front()) : 1;
    NamedChart named{std::string("error-") + axis.name,
                     {e.level + ": " + axis.title,
                      axis.words + std::string(pooled ? ", of our default's: geometric mean" : ""),
                      pooled ? "error, geometric mean over the levels" : "error, geometric mean over the rigs",
                      false,
                      {}}};
    for (const auto& m : e.methods) {
      ChartSeries series{m.title, {}, false};
      for (const Run& r : e.runs) {
        if (r.method != m.name) continue;
        series.points.push_back(
            {unit > 0 ? axis.of(r) / unit : 0, r.error(), words_of(r), &r == default_run(e, m.name)});
      }
      named.chart.series.push_back(std::move(series));
    }
    if (curve != nullptr && std::string(axis.name) == "core-seconds") {
      named.chart.series.push_back({curve->title, curve->points, true});
    }
    charts.push_back(std::move(named));
  }
  if (e.expected) charts.push_back(expected_error_chart(e.level, *e.expected));
  return charts;
}

Equals equals(const Evaluation& e, const std::string& method) {
  const Run& first = e.runs.front();
  const std::vector<Cost> bytes = front_of(e, method, bytes_of), core = front_of(e, method, core_seconds_of);
  return {error_at(bytes, bytes_of(first)), cost_at(bytes, first.error()), error_at(core, core_seconds_of(first)),
          cost_at(core, first.error())};
}

std::vector<Beaten> beaten(const Evaluation& e, const Run& run) {
  std::vector<Beaten> out;
  for (const CostAxis& axis : kAxes) {
    Beaten b{axis.words, {}};
    for (const Run& r : e.runs) {
      if (axis.of(r) > 0 && beats({axis.of(r), r.error()}, {axis.of(run), run.error()})) {
        b.by.push_back(title_of(e, r.method) + ", " + r.label);
      }
    }
    if (!b.by.empty()) out.push_back(std::move(b));
  }
  return out;
}

absl::StatusOr<std::vector<StabilityRow>> read_stability(const std::filesystem::path& folder) {
  const std::filesystem::path path = folder / "stability.json";
  LL_ASSIGN_OR_RETURN(const auto bytes, read_file(path));
  try {
    std::vector<StabilityRow> rows;
    for (const auto& r : nlohmann::json::parse(bytes.begin(), bytes.end())) {
      const std::string picture = r.value("picture", "");
      rows.push_back({r.at("case"), r.at("what"), picture.empty() ? "" : (folder / picture).string(), r.at("measured"),
                      r.at("bound"), r.at("holds")});
    }
    return rows;
  } catch (const nlohmann::json::exception&) {
    return absl::InvalidArgumentError(path.string() + " is not what tests/stability/report writes: run that again");
  }
}

absl::StatusOr<std::string> report_html(const Page& page) {
  const Evaluation& e = page.evaluation;
  std::string out =
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
      "content=\"width=device-width\">\n<title>" +
      escape_markup(e.level) + ": speed against accuracy</title>\n" + kStyle + "</head><body>\n";
  out += "<h1>" + escape_markup(e.level) + ": speed against accuracy</h1>\n<p>" + std::to_string(e.receivers) +
         " receivers, " + std::to_string(e.triangles) + " triangles, " + std::to_string(e.rigs.size()) +
         (e.pooled.empty() ? " rigs of lights, " : " levels, ") + std::to_string(e.bounces) +
         (e.bounces == 1 ? " bounce" : " bounces") + ". " + escape_markup(e.machine) + ".<br><code>" +
         escape_markup(page.command) + "</code></p>\n";
  out += other_machines(e);
  if (!e.pooled.empty()) {
    out +=
        "<p><b>Pooled</b>: of each method the settings that all levels have, relative to its default there; error and "
        "costs are "
        "geometric means over the levels, in charts as multiples of our default's.</p>\n";
  }
  out +=
      "<p><b>Error</b> is rel_rmse, ‖E − E<sub>truth</sub>‖ ÷ ‖E<sub>truth</sub>‖ over receiver texels, weighted by "
      "area, without the noise of the "
      "path-traced truth; over rigs the geometric mean. Bakes take all threads; frames are run on one "
      "thread of the processor, for every method.</p>\n";

  out += "<h2>At each method's default</h2>\n";
  std::vector<Row> rows, equal;
  for (const auto& m : e.methods) {
    if (const Run* run = default_run(e, m.name)) {
      const std::string title = "<b>" + escape_markup(m.title) + "</b>";
      rows.push_back(joined({title, escape_markup(run->label)}, costs_of(*run)));
      equal.push_back(joined({title}, row_of(equals(e, m.name))));
    }
  }
  out += table(joined({"method", "settings"}, kCostTitles), rows, 2);
  out += "<h3>By all settings, against " + escape_markup(e.methods.front().title) + "'s default</h3>\n" +
         table(joined({"method"}, kEqualTitles), equal, 1) +
         "<p><small>Along the front of the method's own settings, straight between them in logarithms. –: none of them "
         "is as "
         "cheap, or as accurate.</small></p>\n";

  out += "<h2>Charts</h2>\n<div class=\"charts\">\n";
  for (const NamedChart& c : page.charts) out += chart_svg(c.chart);
  out += "</div>\n";
  const auto losses = beaten(e, e.runs.front());
  if (losses.empty()) {
    out += "<p>The default of " + escape_markup(e.methods.front().title) + " is on the front of every chart.</p>\n";
  } else {
    out +=
        "<p>The default of " + escape_markup(e.methods.front().title) + " is <b>not</b> on the front of:</p>\n<ul>\n";
    for (const Beaten& b : losses) {
      out += "<li>error against " + escape_markup(b.cost) + ": less in both have ";
      for (size_t i = 0; i < b.by.size(); ++i) out += (i == 0 ? "" : "; ") + escape_markup(b.by[i]);
      out += ".</li>\n";
    }
    out += "</ul>\n";
  }
  if (e.expected) out += expected_error_words(*e.expected);
  if (page.curve != nullptr && !page.curve->about.empty()) {
    out += "<p><small>" + escape_markup(page.curve->title) + ": " + escape_markup(page.curve->about) + "</small></p>\n";
  }

  if (!page.sheets.empty()) {
    out +=
        "<h2>Pictures</h2>\n<p>E at each method's default, its error |ΔE| ÷ mean E in view from 0 <span class=\"ramp\" "
        "style=\"background:linear-gradient(90deg," +
        css_ramp() + ")\"></span> " + format("%.1f", static_cast<double>(kHeatTop)) +
        " and above, and below both a closer look where the first method errs most.</p>\n";
    for (const Sheet& sheet : page.sheets) {
      LL_ASSIGN_OR_RETURN(const std::string markup, sheet_markup(page, sheet));
      out += markup;
    }
  }

  out += e.pooled.empty() ? rigs_markup(e) : levels_markup(e, page.levels);

  out += "<h2>Everything that was measured</h2>\n";
  rows.clear();
  for (const Run& r : e.runs) {
    rows.push_back(joined({escape_markup(title_of(e, r.method)), escape_markup(r.label)}, costs_of(r)));
  }
  out += table(joined({"method", "settings"}, kCostTitles), rows, 2);

  if (!page.stability.empty()) {
    out += "<h2>Where methods fail</h2>\n";
    rows.clear();
    for (const StabilityRow& s : page.stability) {
      LL_ASSIGN_OR_RETURN(const std::string shown, picture(s.picture, s.what));
      rows.push_back({escape_markup(s.name), escape_markup(s.what),
                      shown.empty() ? "" : "<div style=\"max-width:300px\" class=\"pair\">" + shown + "</div>",
                      format("%.3g", s.measured), format("%.3g", s.bound),
                      s.holds ? "holds" : "<b class=\"bad\">fails</b>"});
    }
    out += table({"case", "what", "", "measured", "bound", ""}, rows, 3);
  }

  out += "<h2>Methods</h2>\n<dl>\n";
  for (const auto& m : e.methods)
    out += "<dt><b>" + escape_markup(m.title) + "</b> <code>" + m.name + "</code></dt><dd>" + escape_markup(m.about) +
           "</dd>\n";
  return out + "</dl>\n</body></html>\n";
}

}  // namespace lightloom::eval
