// SPDX-License-Identifier: MIT
#include "tests/lab/report/plan.h"

#include "tests/lab/engine_error.h"
#include "tests/lab/error_vs_runtime.h"
#include "tests/lab/extremes.h"
#include "tests/lab/fig6.h"
#include "tests/lab/gallery.h"
#include "tests/lab/multirate.h"
#include "tests/lab/planes.h"
#include "tests/lab/push_traces.h"
#include "tests/lab/pushes.h"
#include "tests/lab/scene_cost.h"
#include "tests/lab/slides.h"
#include "tests/lab/soft_press.h"
#include "tests/lab/subjects.h"
#include "tests/lab/tensions.h"
#include "tests/lab/wall.h"

namespace rikiseki::lab {
namespace {

Chapter OwnGrid(const Case& study, bool quick, double row_s) {
  return {.name = study.name, .study = study, .rows = study.grid(quick), .row_s = row_s};
}

// Every `every`-th row of a table of tests/data.
Chapter Reference(const std::string& file, const Case& study, std::size_t every, double row_s) {
  const Table all = Table::Load(RIKISEKI_DATA_DIR "/" + file + ".csv");
  std::vector<std::size_t> indices;
  for (std::size_t i = 0; i < all.size(); i += every) indices.push_back(i);
  return {
      .name = "reference_" + file, .study = study, .rows = all.Select(indices, {}), .row_s = row_s};
}

// Stiffness of a wall by rate, wall damping and delay; and the pair of Love & Book.
Table WallRows(bool quick) {
  Table table("the walls of the report", {"T_s", "m_kg", "b_Ns_m", "B_Ns_m", "delay_samples"});
  const std::vector<double> periods =
      quick ? std::vector{2.5e-4, 5e-4, 1e-3, 2e-3, 4e-3, 1e-2}
            : std::vector{1.25e-4, 2.5e-4, 5e-4, 1e-3, 2e-3, 4e-3, 1e-2, 2e-2};
  // The device alone, and held by a medium and a firm hand.
  for (const auto& [mass_kg, damping] :
       {std::pair(0.03, 0.2), std::pair(0.58, 6.7), std::pair(0.93, 15.2)}) {
    for (const double wall_damping : {0.0, 2.0, 10.0}) {
      for (int delay = 0; delay <= 1; ++delay) {
        for (const double period_s : periods) {
          table.Append({ToField(period_s), ToField(mass_kg), ToField(damping),
                        ToField(wall_damping), std::to_string(delay)});
        }
      }
    }
  }
  for (const double period_s : {1e-2, 1e-3}) {
    for (const double mass_kg : {2.9, 7.2}) {
      table.Append({ToField(period_s), ToField(mass_kg), "35.2", "0", "0"});
    }
  }
  return table;
}

// Any device: K_max T^2/m is a function of b T/m, B T/m and the delay alone, so one of 1 kg at 1 kHz
// stands for all.
Table AnyWallRows() {
  Table table("the walls of any device", {"T_s", "m_kg", "b_Ns_m", "B_Ns_m", "delay_samples"});
  for (const double device : {0.001, 0.003, 0.01, 0.03, 0.1, 0.3}) {
    for (const double wall : {0.0, 0.003, 0.01, 0.03, 0.1, 0.3, 0.7, 1.0, 1.4}) {
      for (int delay = 0; delay <= 2; ++delay) {
        table.Append(
            {"0.001", "1", ToField(1e3 * device), ToField(1e3 * wall), std::to_string(delay)});
      }
    }
  }
  return table;
}

// The finger's own friction, on what is curved and what has an edge (paper 5.3).
Table SlideRows(bool quick) {
  Table table("the slides of the report", {"script", "mu", "coupling", "Tw_s", "phases"});
  for (const char* script : {"sphere", "edge", "free"}) {
    for (const char* coupling : {"position", "impulse", "local"}) {
      for (const char* world_period_s : {"0.02", "0.05", "0.1", "0.2"}) {
        table.Append({script, "0.3", coupling, world_period_s, quick ? "2" : "10"});
      }
    }
  }
  return table;
}

// Object mass against world period, stiffness and haptic period.
Table MassRows(bool quick) {
  Table table("the masses of the report", {"T_s", "Tw_s", "kp_N_m", "kd_Ns_m", "hand", "method"});
  const std::vector<const char*> methods = {"conv", "impulse_interp", "local_AUTH"};
  const auto append = [&](double period_s, double world_period_s, double stiffness,
                          const char* hand, const char* method) {
    table.Append(
        {ToField(period_s), ToField(world_period_s), ToField(stiffness), "2", hand, method});
  };
  for (const double world_period_s :
       quick ? std::vector{0.02, 0.05, 0.1}
             : std::vector{0.005, 0.01, 0.016, 0.02, 0.033, 0.05, 0.07, 0.1, 0.14, 0.2}) {
    for (const char* hand : {"light", "medium", "firm"}) {
      for (const char* method : methods) append(1e-3, world_period_s, 2000, hand, method);
    }
  }
  for (const double stiffness :
       quick ? std::vector{100.0, 1e4} : std::vector{10.0, 100.0, 500.0, 1e4, 1e5}) {
    for (const char* method : methods) append(1e-3, 0.05, stiffness, "medium", method);
    append(1e-3, 0.05, stiffness, "medium", "local_M1_implicit");
  }
  for (const double period_s :
       quick ? std::vector{2e-3, 5e-4} : std::vector{4e-3, 2e-3, 5e-4, 2.5e-4}) {
    for (const char* method : methods) append(period_s, 0.1, 2000, "medium", method);
  }
  return table;
}

Table PushRows(bool quick) {
  const Table truth = Table::Load(RIKISEKI_DATA_DIR "/push_table.csv");
  Table table("the pushes of the report",
              {"script", "mass_kg", "kd", "coupling", "Tw_s", "phases"});
  for (std::size_t i = 0; i < truth.size(); i += quick ? 5 : 1) {
    const Row row = truth.row(i);
    const std::vector<std::string> push = {row.Text("script"), row.Text("mass_kg"), row.Text("kd")};
    const auto append = [&](const char* coupling, const char* world_period_s) {
      std::vector<std::string> fields = push;
      fields.insert(fields.end(), {coupling, world_period_s, quick ? "5" : "20"});
      table.Append(fields);
    };
    append("single", "");
    for (const char* world_period_s : {"0.02", "0.05", "0.1"}) {
      for (const char* coupling : {"position", "impulse", "local"}) {
        append(coupling, world_period_s);
      }
    }
  }
  return table;
}

Table GalleryRows(bool quick) {
  Table table("the scenes of the report", {"scene", "seconds"});
  for (const std::string& path : GalleryScenes()) {
    const std::string scene = path.substr(path.rfind('/') + 1);
    const bool large = scene == "thousand.sdf";
    if (quick && large) continue;
    table.Append({scene, quick ? "1" : large ? "20" : "60"});
  }
  return table;
}

Table SceneCostRows(bool quick) {
  const Table all = SceneCost().grid(quick);
  std::vector<std::size_t> kept;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (all.row(i).Text("scene") != "thousand.sdf") kept.push_back(i);
  }
  return all.Select(kept, {});
}

}  // namespace

std::vector<Chapter> ReportPlan(bool quick) {
  std::vector<Chapter> chapters = {
      Reference("plane_cases", Planes(), 1, 0.01),
      Reference("spidar_tension_cases", Tensions(), 1, 0.01),
      Reference("fig6_runs_P", Fig6(), 1, 0.01),
      Reference("fig6_runs_H", Fig6(), 1, 0.01),
      Reference("multirate_rho_samples", MultirateGrowth(), quick ? 4 : 1, 0.1),
      Reference("multirate_minmass", MultirateMasses(), quick ? 40 : 1, 1),
      Reference("wall_kmax", Wall(), quick ? 20 : 1, 1),
      Reference("push_table", Pushes(), quick ? 5 : 1, 0.1),
      OwnGrid(ErrorVsRuntime(), quick, quick ? 0.5 : 3),
      OwnGrid(EngineError(), quick, 0.5),
      {.name = "wall", .study = Wall(), .rows = WallRows(quick), .row_s = 0.5},
      {.name = "any-wall", .study = Wall(), .rows = AnyWallRows(), .row_s = 0.02},
      {.name = "masses", .study = MultirateMasses(), .rows = MassRows(quick), .row_s = 1},
      OwnGrid(Extremes(), quick, 0.3),
      {.name = "pushes", .study = Pushes(), .rows = PushRows(quick), .row_s = quick ? 0.3 : 1.5},
      {.name = "gallery", .study = Gallery(), .rows = GalleryRows(quick), .row_s = quick ? 0.5 : 8},
      OwnGrid(PushTraces(), quick, 0.02),
      OwnGrid(Subjects(), quick, 0.3),
      {.name = "slides", .study = Slides(), .rows = SlideRows(quick), .row_s = 0.05},
      OwnGrid(SoftPresses(), quick, 0.2),
      {.name = "scene-cost",
       .study = SceneCost(),
       .rows = SceneCostRows(quick),
       .row_s = quick ? 0.5 : 3,
       .alone = true}};
  return chapters;
}

}  // namespace rikiseki::lab
