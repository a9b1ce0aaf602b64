#include "cli/eval/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/file.h"
#include "tests/support/baked_level.h"

namespace lightloom::eval {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

Run run(const std::string& method, const std::string& label, double seconds, uint64_t bytes, double error) {
  Run r;
  r.method = method;
  r.label = label;
  r.facts.bytes = bytes;
  Facts one = r.facts;
  one.seconds = one.core_seconds = seconds;
  r.add_times(one);
  if (method != "static") r.frame_ms = {seconds};
  r.rigs = {{"lamp <1>", error, 0, 0, 0, 0, 0}};
  return r;
}

Evaluation example() {
  Evaluation e;
  e.level = "<b>hall</b>";
  e.rigs = {{"lamp <1>", 0.01, 64}};
  e.methods = {{"default", "ours", "as it is"}, {"other", "theirs", "by R & D"}, {"static", "fixed", ""}};
  e.runs = {run("default", "default", 2, 2000, 0.05), run("default", "spacing ×2", 1, 900, 0.1),
            run("other", "default", 3, 1000, 0.04), run("static", "64", 4, 10, 0.2)};
  return e;
}

TEST(Report, SaysWhereAndByWhomTheDefaultIsBeaten) {
  const Evaluation e = example();
  const auto losses = beaten(e, e.runs.front());
  ASSERT_EQ(losses.size(), 1u);
  EXPECT_EQ(losses[0].cost, "bytes stored");
  EXPECT_THAT(losses[0].by, ::testing::ElementsAre("theirs, default"));
  EXPECT_THAT(beaten(e, e.runs[2]), IsEmpty());
}

TEST(Report, SaysWhatEachMethodHasForAsMuch) {
  const Evaluation e = example();  // ours: 0.05 in 2000 bytes, 0.1 in 900
  const Equals ours = equals(e, "default"), other = equals(e, "other"), fixed = equals(e, "static");
  EXPECT_NEAR(*ours.error_in_bytes, 0.05, 1e-12);
  EXPECT_EQ(ours.bytes_for_error, 2000);
  EXPECT_NEAR(*other.error_in_bytes, 0.04, 1e-12);
  EXPECT_EQ(other.bytes_for_error, 1000);
  EXPECT_EQ(other.error_in_core_seconds, std::nullopt);
  EXPECT_NEAR(*fixed.error_in_bytes, 0.2, 1e-12);
  EXPECT_EQ(fixed.bytes_for_error, std::nullopt);
}

TEST(Report, IsOnePageThatNeedsNothingElse) {
  const test::TemporaryFolder folder;
  Image image(4, 4, {"R", "G", "B"});
  ASSERT_TRUE(write_png(image, folder.path() / "p.png").ok());
  const std::string png = (folder.path() / "p.png").string();
  const Evaluation e = example();
  const std::vector<Sheet> sheets = {
      {"lamp <1>", "the worst", {{"path traced", png, "", png, ""}, {"ours", png, png, png, png}}}};
  const auto charts = make_charts(e, nullptr);
  const Page page{
      e, charts, sheets, nullptr, {{"walls", "leak & co", png, 2e-3, 1e-3, false}}, "lightloom eval hall.glb", {}};
  const auto html = report_html(page);
  ASSERT_TRUE(html.ok()) << html.status();
  EXPECT_THAT(*html, HasSubstr("data:image/png;base64,iVBOR"));
  EXPECT_THAT(*html, HasSubstr("&lt;b&gt;hall&lt;/b&gt;: speed against accuracy"));
  EXPECT_THAT(*html, HasSubstr("lamp &lt;1&gt;"));
  EXPECT_THAT(*html, HasSubstr("is <b>not</b> on the front of"));
  EXPECT_THAT(*html, HasSubstr("<b class=\"bad\">fails</b>"));
  for (const char* outside : {"<script", "src=\"http", "href=", "url("}) EXPECT_THAT(*html, Not(HasSubstr(outside)));
}

TEST(Report, SaysWhichTimesAreOfAnotherMachine) {
  Evaluation e = example();
  e.machine = "new, 2 threads";
  for (auto& r : e.runs) r.machines = {e.machine};
  const auto html = [&] { return report_html({e, {}, {}, nullptr, {}, "", {}}).value(); };
  EXPECT_THAT(html(), Not(HasSubstr("another machine")));
  e.runs[2].machines.insert("old, 4 threads");
  EXPECT_THAT(html(), HasSubstr("another machine</b>, old, 4 threads: theirs, default.</p>"));
}

TEST(Report, ComesBackFromDisk) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "evaluation.json";
  Evaluation e = example();
  e.expected = ExpectedError{{0.1, 0.2, 0.3}, {1, 2, 4}, {5, 9, 7}, 0.25};
  ASSERT_TRUE(save(e, path).ok());
  const auto back = load_evaluation(path);
  ASSERT_TRUE(back.ok()) << back.status();
  ASSERT_TRUE(back->expected);
  EXPECT_EQ(back->expected->correlation(), 1);
  EXPECT_EQ(back->expected->own_correlation(), 0.5);
  EXPECT_EQ(back->expected->noise, 0.25);
  EXPECT_EQ(results_csv(back->level, back->runs), results_csv(example().level, example().runs));
  EXPECT_EQ(back->methods.size(), 3u);
  ASSERT_TRUE(write_file_atomic(path, "{}").ok());
  EXPECT_THAT(std::string(load_evaluation(path).status().message()), HasSubstr("is no evaluation"));
}

TEST(Chart, MarksTheFrontAndLeavesOutWhatHasNoPlace) {
  const auto charts = make_charts(example(), nullptr);
  ASSERT_EQ(charts.size(), 5u);
  const std::string frames = chart_svg(charts[3].chart);
  EXPECT_THAT(frames, HasSubstr("ours, default: error 0.0500"));
  EXPECT_THAT(frames, Not(HasSubstr("fixed, 64")));  // it has no frames
  const std::string bytes = chart_svg(charts[2].chart);
  EXPECT_THAT(bytes, HasSubstr("fixed, 64"));
  EXPECT_THAT(bytes, HasSubstr("&lt;b&gt;hall"));
}

TEST(Chart, OfNothingIsAChart) {
  const std::string svg = chart_svg({"none", "x", "y", false, {{"a", {{0, 1, "", false}}, false}}});
  EXPECT_THAT(svg, HasSubstr("</svg>"));
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
  EXPECT_THAT(svg, Not(HasSubstr("inf")));
}

TEST(Chart, OfExpectedErrorsHasTheirMedians) {
  Evaluation e = example();
  e.expected = ExpectedError{};
  for (int i = 1; i <= 100; ++i) {
    e.expected->norm.push_back(0.01 * i);
    e.expected->error.push_back(1);
    e.expected->own_error.push_back(0.001 * (i <= 50 ? i : 51));
  }
  EXPECT_EQ(e.expected->correlation(), 0);
  EXPECT_GT(e.expected->own_correlation(), 0.9);
  const auto tenths = e.expected->tenths();
  ASSERT_EQ(tenths.size(), 10u);
  EXPECT_NEAR(tenths[0].norm, 0.055, 1e-9);
  EXPECT_NEAR(tenths[9].error, 0.051, 1e-9);
  const auto charts = make_charts(e, nullptr);
  ASSERT_EQ(charts.back().name, "operator-norm");
  const std::string svg = chart_svg(charts.back().chart);
  EXPECT_THAT(svg, HasSubstr("norm 0.055, error 0.0055"));
  EXPECT_THAT(svg, Not(HasSubstr("Pareto")));
}

TEST(Curve, ThoseOnRecordAreReadable) {
  int count = 0;
  for (const auto& file : std::filesystem::directory_iterator(LIGHTLOOM_SOURCE_DIR "/docs/results/cycles")) {
    const auto curve = read_curve(file.path());
    ASSERT_TRUE(curve.ok()) << curve.status();
    EXPECT_GT(curve->points.size(), 2u) << file.path();
    for (size_t i = 1; i < curve->points.size(); ++i) {
      EXPECT_LT(curve->points[i].y, curve->points[i - 1].y) << file.path();  // more samples, less error
    }
    ++count;
  }
  EXPECT_EQ(count, 5);
}

TEST(Curve, IsReadLineByLine) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "c.csv";
  ASSERT_TRUE(write_file_atomic(
                  path, "# Cycles\n# on one thread\ncore_seconds,error,words\n0.5,0.25,16 spp\n2,0.125,64 spp, clean\n")
                  .ok());
  const auto curve = read_curve(path);
  ASSERT_TRUE(curve.ok()) << curve.status();
  EXPECT_EQ(curve->title, "Cycles");
  EXPECT_EQ(curve->about, "on one thread");
  ASSERT_EQ(curve->points.size(), 2u);
  EXPECT_EQ(curve->points[1].words, "64 spp, clean");
  for (const char* bad : {"x,y\n", "core_seconds,error,words\n1,0,a\n", "core_seconds,error,words\n1\n",
                          "core_seconds,error,words\nnan,1,a\n"}) {
    ASSERT_TRUE(write_file_atomic(path, bad).ok());
    EXPECT_THAT(std::string(read_curve(path).status().message()), HasSubstr("expected core_seconds,error,words"))
        << bad;
  }
}

}  // namespace
}  // namespace lightloom::eval
