// SPDX-License-Identifier: MIT
// Error against run time: the figures of the prototypes, what must be so of any error, and that only
// the times of two runs differ.
#include "tests/lab/error_vs_runtime.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <sstream>

#include "common/config.h"
#include "tests/lab/case_row.h"
#include "tests/lab/error_run.h"

namespace rikiseki::lab {
namespace {

test::RowResult Run(const std::string& system, const std::string& coupling,
                    const std::string& display, double period_s, double world_period_s,
                    int phases = 4) {
  return test::RunText(ErrorVsRuntime(), "system,coupling,display,T_s,Tw_s,phases\n" + system +
                                             "," + coupling + "," + display + "," +
                                             ToField(period_s) + "," + ToField(world_period_s) +
                                             "," + std::to_string(phases) + "\n");
}

bool IsTime(const std::string& column) {
  return column == "cpu_s_per_s" || column.ends_with("_us");
}

}  // namespace

TEST_CASE("error-vs-runtime: the errors of H are as large as the prototypes'") {
  const Table expected = Table::Load(RIKISEKI_SOURCE_DIR "/tests/data/error_h.csv");
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const Row row = expected.row(i);
    const double rms_mm = row.Number("rms_mm", 0, 1e3);
    const auto got = Run("H", row.Text("coupling"), row.Find("display").value_or(""),
                         row.Number("T_s", 0, 1), row.Number("Tw_s", 0, 1), 5);
    CAPTURE(row.Text("coupling"), row.Text("Tw_s"), rms_mm);
    REQUIRE(got.status == RowStatus::kOk);
    const double got_mm = 1e3 * got.got.at("continuous_rms_m");
    // 5 phases of the 20, and a prototype's friction rule: a sixth, and 0.4 mm that v T/2 of 1 m/s is.
    // The prototype's `local` sent a block per period; ours must be better at 100 ms, not alike.
    if (row.Text("coupling") == "local") {
      CHECK(got_mm < rms_mm + 0.5);
    } else {
      CHECK(std::abs(got_mm - rms_mm) < rms_mm / 6 + 0.4);
    }
  }
}

TEST_CASE(
    "error-vs-runtime: the split costs local next to nothing, and position and impulse a lot") {
  for (const char* system : {"offcentre", "corner", "stack"}) {
    CAPTURE(system);
    const double local = Run(system, "local", "", 1e-3, 0.05).got.at("split_rms_m");
    const double impulse = Run(system, "impulse", "interpolate", 1e-3, 0.05).got.at("split_rms_m");
    const double position =
        Run(system, "position", "interpolate", 1e-3, 0.05).got.at("split_rms_m");
    CHECK(local < 1e-3);  // numerics 5: 1 % of about 70 mm
    CHECK(impulse > 50 * local);
    CHECK(position > 50 * local);
  }
}

TEST_CASE(
    "error-vs-runtime: bias and spread make the RMS, and two runs differ in their times only") {
  const auto a = Run("P", "impulse", "interpolate", 1e-3, 0.05);
  for (const std::string of : {"split", "continuous"}) {
    CHECK(a.got.at(of + "_rms_m") ==
          Approx(std::hypot(a.got.at(of + "_bias_m"), a.got.at(of + "_sd_m"))).epsilon(1e-9));
    CHECK(a.got.at(of + "_sd_m") > 1e-3);  // the phase matters
  }
  CHECK(a.got.at("cpu_s_per_s") > 0);
  CHECK(a.got.at("haptic_p999_us") >= a.got.at("haptic_p50_us"));
  const auto b = Run("P", "impulse", "interpolate", 1e-3, 0.05);
  for (const auto& [column, value] : a.got) {
    CAPTURE(column);
    if (!IsTime(column)) CHECK(b.got.at(column) == value);
  }
}

TEST_CASE("error-vs-runtime: a single rate has no error of the split") {
  // Held planes, kicks and frames at every tick: the reference itself.
  const auto got = Run("H", "impulse", "hold", 1e-3, 1e-3, 1);
  CHECK(got.got.at("split_rms_m") == 0);
  CHECK(got.got.at("force_rms_n") == 0);
  CHECK(got.got.at("impulse_rms_ns") == 0);
}

TEST_CASE("error-vs-runtime: bytes are counted per second, whatever the phases") {
  const double slow = Run("H", "impulse", "hold", 1e-3, 0.1, 1).got.at("bytes_per_s");
  const double fast = Run("H", "impulse", "hold", 1e-3, 0.005, 1).got.at("bytes_per_s");
  const double half = Run("H", "impulse", "hold", 2e-3, 0.1, 1).got.at("bytes_per_s");
  CHECK(slow > 1000 * 200);  // a tick has at least 88 + 80 bytes, and what it touches
  CHECK(fast > slow);
  CHECK(half == Approx(slow / 2).epsilon(0.05));
}

TEST_CASE("error-vs-runtime refuses rows that make no sense") {
  CHECK_THROWS_AS(Run("Q", "local", "", 1e-3, 0.05), ConfigError);
  CHECK_THROWS_AS(Run("P", "magic", "", 1e-3, 0.05), ConfigError);
  CHECK_THROWS_WITH(Run("P", "local", "", 3e-3, 0.05),
                    Catch::Contains("a whole number of haptic periods"));
}

TEST_CASE(
    "force traces are compared where either is in contact, the shorter one filled up with 0") {
  RunRecord a;
  RunRecord b;
  a.force_n = {Vec3::Zero(), Vec3(3, 0, 0), Vec3::Zero()};
  b.force_n = {Vec3::Zero(), Vec3(0, 4, 0), Vec3::Zero(), Vec3(0, 0, 5)};
  CHECK(ForceTraceError(a, b) == Approx(5));
  CHECK(ForceTraceError(b, a) == Approx(5));
  CHECK(ForceTraceError(a, a) == 0);
  CHECK(ForceTraceError({}, {}) == 0);
}

TEST_CASE("places are compared over runs and bodies") {
  const auto record = [](double x, double y) {
    RunRecord run;
    run.bodies.resize(2);
    run.bodies[0].pose.position.x() = x;
    run.bodies[1].pose.position.y() = y;
    run.bodies[1].pose.orientation = Quat(Eigen::AngleAxisd(y, Vec3::UnitZ()));
    return run;
  };
  const PlaceError error = CompareBodies({record(1, 3), record(3, 3)}, record(0, 0));
  CHECK(error.bias_m == Approx(std::hypot(2, 3)));
  CHECK(error.sd_m == Approx(1));
  CHECK(error.rms_m == Approx(std::sqrt(14.0)));
  CHECK(error.turn_rad == Approx(3));
}

}  // namespace rikiseki::lab
