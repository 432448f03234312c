// SPDX-License-Identifier: MIT
#include "tests/lab/slides.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <sstream>
#include <string>

#include "tests/lab/slide_run.h"
#include "world_server/features/nearest_point.h"

namespace rikiseki::lab {
namespace {

constexpr double kTick = 1e-3;  // s

std::string Run(const std::string& text) {
  std::istringstream in(text);
  std::ostringstream out;
  const Case study = Slides();
  WriteStudy(study, RunStudy(study, Table::Read(in, "t.csv"), {}), out);
  return out.str();
}

// Of the finger's sphere in the scene's only body.
double DepthIn(const world::Scene& scene, const Vec3& finger) {
  const world::SceneBody& body = scene.bodies.at(0);
  const Vec3 p = body.pose_WB.Inverse() * finger;
  return kSlideRadius - world::FindNearestPoint(body.colliders.at(0).shape, p).distance;
}

}  // namespace

TEST_CASE("the finger slides at 0.3 m/s, as deep as its script says, round all that is round") {
  for (const SlideScript script : {SlideScript::kSphere, SlideScript::kRound, SlideScript::kEdge}) {
    const Slide slide{.script = script, .depth_m = 0.001};
    const world::Scene scene = SlideScene(slide);
    CAPTURE(static_cast<int>(script));
    CHECK(DepthIn(scene, FingerPosition(slide, 0)) == Approx(-0.005));
    CHECK(DepthIn(scene, FingerPosition(slide, SlideStart(slide))) == Approx(0.001));
    bool leaves = false;
    for (double t_s = SlideStart(slide); t_s + kTick < SlideEnd(slide); t_s += kTick) {
      const Vec3 finger = FingerPosition(slide, t_s);
      const double way = (FingerPosition(slide, t_s + kTick) - finger).norm();
      CHECK(way <= 0.3 * kTick * (1 + 1e-9));
      CHECK(way >= 0.29 * kTick);  // a chord of the edge's small circle
      const double depth = DepthIn(scene, finger);
      leaves = leaves || depth < 0;
      CHECK(depth <= 0.001 + 1e-12);
      if (script != SlideScript::kEdge) CHECK(depth == Approx(0.001));
    }
    CHECK(leaves == (script == SlideScript::kEdge));
  }
}

TEST_CASE("at a single rate the force of the slides is the closed form") {
  // A ball is shown tangent to where the finger is, so the depth is the script's in every tick. Without
  // friction or damping.
  const Slide slide;
  SlideLoops loops{.single = true, .damping_ns_per_m = 0};
  const SlideResult round_sphere = SimulateSlide(slide, loops);
  CHECK(round_sphere.force.size() > 1500);
  for (const Vec3& force : round_sphere.force) {
    CHECK(force.norm() == Approx(2000 * slide.depth_m).epsilon(1e-9));
  }
  // Off the edge it is free.
  const Slide off{.script = SlideScript::kEdge};
  const SlideResult edge = SimulateSlide(off, loops);
  CHECK(edge.force.front().norm() == Approx(4.0));
  CHECK(edge.force.back().norm() == 0);

  // With friction it slides at mu N.
  const Slide rough{.script = SlideScript::kEdge, .friction = 0.3};
  const Vec3 on_top = SimulateSlide(rough, loops).force.at(200);
  CHECK(on_top.z() == Approx(4.0));
  CHECK(on_top.x() == Approx(-0.3 * 4.0));
}

TEST_CASE("a device that is scaled and turned feels the same, scaled and turned") {
  const Slide slide{.script = SlideScript::kRound, .friction = 0.3};
  SlideLoops loops{.world_period_s = 0.05};
  const SlideComparison plain = CompareSlides(slide, loops, 2);
  loops.motion_scale = 5;
  loops.force_scale = 0.2;
  const SlideComparison scaled = CompareSlides(slide, loops, 2);
  CHECK(scaled.force_error_rms_n == Approx(0.2 * plain.force_error_rms_n).epsilon(1e-9));
  CHECK(scaled.single_rms_n == Approx(0.2 * plain.single_rms_n).epsilon(1e-9));
  CHECK(scaled.step_ratio == Approx(0.2 * plain.step_ratio).epsilon(1e-6));
}

TEST_CASE("a ball is round at any world rate: the force is that of a single rate") {
  for (const double friction : {0.0, 0.3}) {
    const Slide slide{.script = SlideScript::kSphere, .friction = friction};
    const SlideComparison got = CompareSlides(slide, {.world_period_s = 0.2}, 2);
    CHECK(got.force_error_peak_n < 1e-9);
    CHECK(got.single_rms_n >= 4 * (1 - 1e-9));
  }
}

// The bars hold for every row: no step above the slew limit of what the finger slides on, books to
// 1e-12, energy to 1e-9. The whole grid with RIKISEKI_FULL=1 only.
TEST_CASE("slides keep their bars, and impulse and energy are accounted for with any scales") {
  const Case study = Slides();
  const char* full = std::getenv("RIKISEKI_FULL");
  const Table table = study.grid(/*quick=*/full == nullptr || std::string(full) != "1");
  const StudyResult result = RunStudy(study, table, {.jobs = 2});
  CHECK(result.Count(RowStatus::kOk) == table.size());
  std::ostringstream said;
  study.summarise(result.rows, result.outcomes, said);
  CHECK(said.str().find("sphere, mu 0.3, scales 5 0.2, local") != std::string::npos);
}

TEST_CASE("rows of slides are read, computed, compared, and missed where a bar is broken") {
  const std::string header = "script,mu,coupling,Tw_s,kp,phases";
  const std::string out =
      Run(header + ",single_rms_n,note\n" + "sphere,0,impulse,0.02,2000,1,4,a\n" +
          "sphere,0,impulse,0.02,2000,1,4.1,b\n" +
          // 50 um a tick into 1 MN/m: ten times the slew limit
          "sphere,0,impulse,0.02,1000000,1,,c\n");
  std::istringstream lines(out);
  std::string line;
  std::getline(lines, line);
  CHECK(line == header + ",single_rms_n,note,got_step_ratio,got_force_error_rms_n," +
                    "got_force_error_peak_n,got_single_rms_n,got_books_error,got_energy_error," +
                    "got_status");
  std::getline(lines, line);
  CHECK(line.ends_with(",ok"));
  std::getline(lines, line);
  CHECK(line.ends_with(",missed"));
  std::getline(lines, line);
  CHECK(line.ends_with(",missed"));

  const auto refusal = [](const std::string& row) -> std::string {
    try {
      Run("script,coupling,Tw_s,depth_m\n" + row + "\n");
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "";
  };
  CHECK(refusal("skate,impulse,0.02,").starts_with("t.csv:2: script = skate: one of edge, "));
  CHECK(refusal("edge,glue,0.02,").starts_with("t.csv:2: coupling = glue: one of impulse, "));
  CHECK(refusal("edge,impulse,,").starts_with("t.csv:2: column Tw_s "));
  CHECK(refusal("edge,impulse,0.02,0.02").starts_with("t.csv:2: depth_m = 0.02: "));
}

}  // namespace rikiseki::lab
