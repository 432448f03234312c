// SPDX-License-Identifier: MIT
#include "tests/lab/report/html.h"

#include "common/text.h"

namespace rikiseki::lab {
namespace {

// Colours for light and dark; each series keeps its own in both.
constexpr const char* kStyle = R"(
:root { color-scheme: light dark; --text: #1c2024; --back: #ffffff; --soft: #f2f4f6; --grid: #d8dde2;
  --c0: #c2410c; --c1: #1d4ed8; --c2: #047857; --c3: #7e22ce; --c4: #be185d; --c5: #57606a; }
@media (prefers-color-scheme: dark) { :root { --text: #e4e7ea; --back: #14171a; --soft: #20252a;
  --grid: #39414a; --c0: #fb923c; --c1: #7aa2ff; --c2: #4ade80; --c3: #d8a4ff; --c4: #f472b6;
  --c5: #a8b0b8; } }
body { font: 15px/1.5 system-ui, sans-serif; color: var(--text); background: var(--back);
  max-width: 1240px; margin: 0 auto; padding: 1.5em; }
h1 { font-size: 1.7em; } h2 { margin-top: 2em; border-bottom: 1px solid var(--grid); }
table { border-collapse: collapse; margin: 1em 0; display: block; overflow-x: auto; }
th, td { padding: .2em .7em; border-bottom: 1px solid var(--grid); text-align: right;
  font-variant-numeric: tabular-nums; white-space: nowrap; }
th:first-child, td:first-child { text-align: left; }
thead th { background: var(--soft); white-space: normal; vertical-align: bottom; }
code { background: var(--soft); padding: .1em .35em; border-radius: 3px; }
p.command { font-size: .85em; } p.warning { border-left: 4px solid var(--c0); padding-left: .8em; }
details { margin: 1em 0; } summary { cursor: pointer; }
.figures { display: grid; grid-template-columns: repeat(auto-fit, minmax(400px, 1fr)); gap: 1em; }
.plot { width: 100%; height: auto; } .plot text { fill: var(--text); font-size: 11px; }
.plot .title { font-size: 13px; font-weight: 600; } .plot .axis { font-size: 12px; }
.grid { stroke: var(--grid); stroke-width: .7; fill: none; }
.frame { stroke: var(--text); fill: none; stroke-width: .8; }
.line, .dotted { fill: none; stroke-width: 1.6; } .dotted { stroke-dasharray: 5 4; }
.cross { fill: none; stroke-width: 2; } .bar { fill: none; stroke-width: 5; opacity: .75; }
.c0 { stroke: var(--c0); } .c1 { stroke: var(--c1); } .c2 { stroke: var(--c2); }
.c3 { stroke: var(--c3); } .c4 { stroke: var(--c4); } .c5 { stroke: var(--c5); }
.dot { stroke: none; } .dot.c0 { fill: var(--c0); } .dot.c1 { fill: var(--c1); }
.dot.c2 { fill: var(--c2); } .dot.c3 { fill: var(--c3); } .dot.c4 { fill: var(--c4); }
.dot.c5 { fill: var(--c5); }
)";

}  // namespace

void Html::Heading(const std::string& text, const std::string& anchor) {
  out_ << "<h2 id=\"" << Escaped(anchor) << "\">" << Escaped(text) << "</h2>\n";
  contents_ << "<li><a href=\"#" << Escaped(anchor) << "\">" << Escaped(text) << "</a></li>\n";
}

void Html::Subheading(const std::string& text) {
  out_ << "<h3>" << Escaped(text) << "</h3>\n";
}

void Html::Paragraph(const std::string& text) {
  out_ << "<p>" << Escaped(text) << "</p>\n";
}

void Html::Warning(const std::string& text) {
  out_ << "<p class=\"warning\">" << Escaped(text) << "</p>\n";
}

void Html::List(const std::vector<std::string>& items) {
  out_ << "<ul>\n";
  for (const std::string& item : items) out_ << "<li>" << Escaped(item) << "</li>\n";
  out_ << "</ul>\n";
}

void Html::Table(const std::vector<std::string>& header,
                 const std::vector<std::vector<std::string>>& rows) {
  out_ << "<table><thead><tr>";
  for (const std::string& field : header) out_ << "<th>" << Escaped(field) << "</th>";
  out_ << "</tr></thead><tbody>\n";
  for (const auto& row : rows) {
    out_ << "<tr>";
    for (const std::string& field : row) out_ << "<td>" << Escaped(field) << "</td>";
    out_ << "</tr>\n";
  }
  out_ << "</tbody></table>\n";
}

void Html::FoldedTable(const std::string& summary, const std::vector<std::string>& header,
                       const std::vector<std::vector<std::string>>& rows) {
  out_ << "<details><summary>" << Escaped(summary) << "</summary>\n";
  Table(header, rows);
  out_ << "</details>\n";
}

void Html::Figures(const std::vector<Plot>& plots) {
  out_ << "<div class=\"figures\">\n";
  for (const Plot& plot : plots) out_ << "<figure>" << Svg(plot) << "</figure>\n";
  out_ << "</div>\n";
}

void Html::Command(const std::string& text, const std::string& machines) {
  out_ << "<p class=\"command\">Repeat with <code>" << Escaped(text) << "</code>"
       << (machines.empty() ? "" : "; run on " + Escaped(machines)) << "</p>\n";
}

std::string Html::Page(const std::string& title) const {
  return "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
         "<meta name=\"viewport\" content=\"width=device-width\"><title>" +
         Escaped(title) + "</title><style>" + kStyle + "</style></head>\n<body><h1>" +
         Escaped(title) + "</h1>\n<nav><ol>\n" + contents_.str() + "</ol></nav>\n" + out_.str() +
         "</body></html>\n";
}

}  // namespace rikiseki::lab
