// SPDX-License-Identifier: MIT
// The text of the report's page, part by part. Everything that is passed in as text is escaped.
#pragma once

#include <sstream>
#include <string>
#include <vector>

#include "tests/lab/report/svg_plot.h"

namespace rikiseki::lab {

class Html {
 public:
  void Heading(const std::string& text, const std::string& anchor);
  void Subheading(const std::string& text);
  void Paragraph(const std::string& text);
  /// What must not be overlooked.
  void Warning(const std::string& text);
  void List(const std::vector<std::string>& items);
  /// The first column is text, the others stand on the right.
  void Table(const std::vector<std::string>& header,
             const std::vector<std::vector<std::string>>& rows);
  /// The same, out of the way until somebody opens it.
  void FoldedTable(const std::string& summary, const std::vector<std::string>& header,
                   const std::vector<std::vector<std::string>>& rows);
  void Figures(const std::vector<Plot>& plots);
  /// The command that repeats what stands above, and the computers that it ran on.
  void Command(const std::string& text, const std::string& machines = "");

  /// The whole page around these parts, with everything it needs in itself.
  std::string Page(const std::string& title) const;

 private:
  std::ostringstream out_;
  std::ostringstream contents_;
};

}  // namespace rikiseki::lab
