// SPDX-License-Identifier: MIT
// The report's sections: each reads finished rows, and says what they say in words, tables and figures.
// A section whose rows are missing says so.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "tests/lab/report/html.h"
#include "tests/lab/report/plan.h"
#include "tests/lab/report/runner.h"

namespace rikiseki::lab {

/// answers_section.cpp: the four questions that a lab has, answered from the rows of all chapters.
void WriteAnswers(const Results& results, Html& page);
/// error_section.cpp: error against run time.
void WriteError(const Results& results, Html& page);
/// budgets_section.cpp: what each coupling gets right within a CPU budget, by the rows of error-vs-runtime.
void WriteBudgets(const std::vector<ResultRow>& rows, Html& page);
/// stability_section.cpp
void WriteStability(const Results& results, Html& page);
/// scenes_section.cpp: what scenes leave out, and what it costs.
void WriteScenes(const Results& results, Html& page);
/// remarks_section.cpp: what the paper's section 5 remarks, and whether it holds here.
void WriteRemarks(const Results& results, Html& page);
/// paper_section.cpp: the paper's figures, its claims, and the pushes against other software.
void WritePaper(const Results& results, Html& page);
/// paper_section.cpp: the same task done by people, where there are rows of it.
void WritePeople(const Results& results, Html& page);
/// references_section.cpp: the worst deviation from every reference row. Returns how many were missed.
std::size_t WriteReferences(const std::vector<Chapter>& chapters, const Results& results,
                            Html& page);

/// The rows of a chapter; none where it was not run.
const std::vector<ResultRow>& RowsOf(const Results& results, const std::string& chapter);

/// The first row of a chapter in which every named column has that text; null if there is none.
const ResultRow* FindRow(const std::vector<ResultRow>& rows,
                         const std::vector<std::pair<std::string, std::string>>& columns);

/// How many rows missed a result that they expect, or a bar that holds for all.
std::size_t CountMissed(const std::vector<ResultRow>& rows);

/// RMS over the subjects of `fig9` of the SD of where the cube stopped [m]; `subjects` is how many.
double SpreadOf(const std::vector<ResultRow>& rows, const std::string& hand,
                const std::string& mass, const std::string& world_period,
                const std::string& coupling, std::size_t& subjects);

/// The masses at which a lasting contact is stable, by a row of `masses`.
struct MassInterval {
  double from_kg;
  double to_kg;  // inf: any above
};
std::vector<MassInterval> StableIntervals(const ResultRow& row);
/// The same in words, in kg: "0.458 and more".
std::string StableMasses(const ResultRow& row);

/// Says with which command a chapter's rows are run again from their file, and where they ran.
void Repeat(const std::string& command, const std::string& chapter,
            const std::vector<ResultRow>& rows, Html& page);

/// "diverged" where a value is not finite, else three digits and the unit.
std::string Value(double value, const std::string& unit = "");

inline const std::vector<std::string> kCouplingNames = {"position", "impulse", "local"};

}  // namespace rikiseki::lab
