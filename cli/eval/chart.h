// A chart of error against cost as SVG: both axes logarithmic, one mark per variant, the Pareto front as a line.
#pragma once

#include <string>
#include <vector>

namespace lightloom::eval {

struct ChartPoint {
  double x = 0, y = 0;  ///< both > 0; others are left out
  std::string words;    ///< said when the mouse is over it
  bool is_default = false;
};

struct ChartSeries {
  std::string title;
  std::vector<ChartPoint> points;
  bool joined = false;  ///< by a line, in order, as measured elsewhere; it takes no part in the front
};

struct Chart {
  std::string title, x_title, y_title;
  bool scatter = false;             ///< dots, without a front and words
  std::vector<ChartSeries> series;  ///< colours and marks follow the order
};

/// Stands alone, and inline in a page. Empty axes say so.
std::string chart_svg(const Chart& chart);

/// `text` fit for HTML and SVG.
std::string escape_markup(const std::string& text);

}  // namespace lightloom::eval
