// SPDX-License-Identifier: MIT
// The program as its users run it: command line, files, exit statuses.
#include <sys/wait.h>

#include <array>
#include <catch2/catch.hpp>
#include <cstdio>
#include <fstream>
#include <sstream>
#include <string>

#include "tests/common/temporary_file.h"

namespace rikiseki::lab {
namespace {

struct Ended {
  int exit_code = -1;
  std::string output;  // stdout and stderr
};

Ended Run(const std::string& arguments) {
  const std::string command = std::string(RIKISEKI_BIN_DIR) + "/haptic_lab " + arguments + " 2>&1";
  FILE* pipe = popen(command.c_str(), "r");
  REQUIRE(pipe != nullptr);
  Ended ended;
  std::array<char, 4096> buffer{};
  for (std::size_t got = 0; (got = fread(buffer.data(), 1, buffer.size(), pipe)) > 0;) {
    ended.output.append(buffer.data(), got);
  }
  const int status = pclose(pipe);
  if (WIFEXITED(status)) ended.exit_code = WEXITSTATUS(status);
  return ended;
}

std::string ReadAll(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

bool Contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

const std::string kHeader = "note,scenario,world_rule,Tw_s,kp,kd,M,method,phase_ticks";
const std::string kRow = "\"a, b\",P,EX,0.05,2000,0,0.5,impulse_interp,0";

}  // namespace

TEST_CASE("haptic_lab tells its cases, options and version") {
  const Ended help = Run("--help");
  CHECK(help.exit_code == 0);
  for (const char* word :
       {"fig6", "--cases", "--out", "--quick", "--jobs", "--shard", "--seed", "--version"}) {
    CAPTURE(word);
    CHECK(Contains(help.output, word));
  }
  const Ended version = Run("--version");
  CHECK(version.exit_code == 0);
  CHECK(version.output.starts_with("haptic_lab "));
}

TEST_CASE("haptic_lab refuses a wrong command line with 64") {
  const Ended unknown = Run("fig7");
  CHECK(unknown.exit_code == 64);
  CHECK(Contains(
      unknown.output,
      "there is no case fig7; those that exist: buzz, engine-error, error-vs-runtime, extremes, "
      "fig6"));
  CHECK(Run("").exit_code == 64);
  CHECK(Run("fig6 extra").exit_code == 64);
  CHECK(Run("fig6 --fast").exit_code == 64);
  CHECK(Run("fig6 --jobs 0").exit_code == 64);
  for (const char* shard : {"0/2", "3/2", "1", "1/", "/2", "1/2/3", "a/b"}) {
    CAPTURE(shard);
    CHECK(Run(std::string("fig6 --shard ") + shard).exit_code == 64);
  }
}

TEST_CASE("haptic_lab refuses a wrong table with 78 and its place") {
  const TemporaryFile table(kHeader + "\n" + kRow + "\nx,P,EX,0.05,2000,0,much,conv,0\n");
  const Ended ended = Run("fig6 --cases " + table.path());
  CHECK(ended.exit_code == 78);
  CHECK(ended.output == "haptic_lab: " + table.path() + ":3: M = much: a number is expected\n");
  CHECK(Run("fig6 --cases no/such.csv").exit_code == 78);
  const TemporaryFile narrow("scenario\nP\n");
  const Ended missing = Run("fig6 --cases " + narrow.path());
  CHECK(missing.exit_code == 78);
  CHECK(Contains(missing.output, ":2: column method is missing"));
}

TEST_CASE("haptic_lab computes rows without results, and writes what it read") {
  const TemporaryFile table(kHeader + "\n" + kRow + "\n");
  const TemporaryFile out("old");
  const Ended ended = Run("fig6 --cases " + table.path() + " --out " + out.path());
  CHECK(ended.exit_code == 0);
  CHECK(Contains(ended.output, "1 rows: 1 ok 0 missed"));
  const std::string text = ReadAll(out.path());
  CHECK(text.starts_with(kHeader + ",got_x_final_m,got_Jtot_Ns,got_v_peak_world_m_s,got_status\n" +
                         kRow + ",0.0859998"));
  CHECK(text.ends_with(",ok\n"));
  CHECK(Contains(Run("fig6 --cases " + table.path()).output, text));
}

TEST_CASE("haptic_lab exits 1 where an expected result is missed, and only there") {
  const auto run = [](const std::string& x) {
    const TemporaryFile table(kHeader + ",x_final_m\n" + kRow + "," + x + "\n");
    return Run("fig6 --cases " + table.path());
  };
  CHECK(run("0.0859998036").exit_code == 0);
  const Ended missed = run("0.0859998056");  // 2e-9 off
  CHECK(missed.exit_code == 1);
  CHECK(Contains(missed.output, ",missed\n"));
  const TemporaryFile local(kHeader +
                            ",x_final_m\nn,P,EX,0.05,2000,0,0.5,local_M1_noreplay,0,0.5\n");
  const Ended unsupported = Run("fig6 --cases " + local.path());
  CHECK(unsupported.exit_code == 0);
  CHECK(Contains(unsupported.output, ",0.5,,,,unsupported\n"));
}

TEST_CASE("haptic_lab meets the reference rows") {
  const std::string data = RIKISEKI_SOURCE_DIR "/tests/data/";
  const Ended pokes = Run("fig6 --cases " + data + "fig6_runs_P.csv");
  CHECK(pokes.exit_code == 0);
  CHECK(Contains(pokes.output, "70 rows: 70 ok 0 missed 0 unstable 0 unsupported"));
  const Ended pushes = Run("fig6 --cases " + data + "fig6_runs_H.csv");
  CHECK(pushes.exit_code == 0);
  CHECK(Contains(pushes.output, "35 rows: 35 ok 0 missed 0 unstable 0 unsupported"));
}

TEST_CASE("haptic_lab runs planes, tensions, walls and both row formats of multirate") {
  const std::string data = RIKISEKI_SOURCE_DIR "/tests/data/";
  const Ended planes = Run("planes --cases " + data + "plane_cases.csv");
  CHECK(planes.exit_code == 0);
  CHECK(Contains(planes.output, "105 rows: 105 ok"));
  const Ended tensions = Run("tensions --cases " + data + "spidar_tension_cases.csv");
  CHECK(tensions.exit_code == 0);
  CHECK(Contains(tensions.output, "120 rows: 120 ok"));
  const Ended growth = Run("multirate --cases " + data + "multirate_rho_samples.csv");
  CHECK(growth.exit_code == 0);
  CHECK(Contains(growth.output, "100 rows: 100 ok"));
  const Ended masses = Run("multirate --shard 9/60 --cases " + data + "multirate_minmass.csv");
  CHECK(masses.exit_code == 0);
  CHECK(Contains(masses.output, "4 rows: 4 ok"));
  CHECK(Contains(masses.output, "got_stable_intervals_kg_in_1e-5..1e4,got_status"));
  const Ended walls = Run("wall --shard 8/60 --cases " + data + "wall_kmax.csv");
  CHECK(walls.exit_code == 0);
  CHECK(Contains(walls.output, "3 rows: 3 ok"));
  const Ended neither = Run("multirate --cases " + data + "wall_kmax.csv");
  CHECK(neither.exit_code == 78);
  CHECK(Contains(neither.output, "wall_kmax.csv: the columns are of no row format of multirate"));
  for (const char* grid : {"planes", "tensions", "wall"}) {
    CAPTURE(grid);
    const Ended own = Run(std::string(grid) + " --quick --shard 1/4");
    CHECK(own.exit_code == 0);
    CHECK(Contains(own.output, " 0 missed"));
  }
  CHECK(Contains(Run("multirate --quick --shard 3/12").output, "Mass [kg] from which on"));
}

TEST_CASE("haptic_lab runs its own grid, whole or in shards") {
  const TemporaryFile out("");
  const Ended ended = Run("fig6 --quick --out " + out.path());
  CHECK(ended.exit_code == 0);
  CHECK(Contains(ended.output, "70 rows: 70 ok"));
  CHECK(Contains(ended.output, "spread"));
  CHECK(Contains(ReadAll(out.path()), "scenario,world_rule,Tw_s,kp,kd,M,method,phase_ticks,got_x"));

  const Ended shard = Run("fig6 --quick --jobs 2 --shard 2/3");
  CHECK(Contains(shard.output, "23 rows: 23 ok"));
}

TEST_CASE("haptic_lab says when it cannot write") {
  const Ended ended = Run("fig6 --quick --out /no/such/folder/out.csv");
  CHECK(ended.exit_code == 1);
  CHECK(Contains(ended.output, "/no/such/folder/out.csv: cannot be written"));
}

TEST_CASE(
    "haptic_lab tells what the features of a scene cost, and that leaving them out changes "
    "nothing") {
  const Ended ended = Run("scene-cost --quick --jobs 1");
  CHECK(ended.exit_code == 0);
  CHECK(Contains(ended.output, "push.sdf"));
  CHECK(Contains(ended.output, "finger friction"));
  CHECK(Contains(ended.output, "identical"));
  const TemporaryFile table("scene,feature,repetitions\npush.sdf,smell,1\n");
  const Ended wrong = Run("scene-cost --cases " + table.path());
  CHECK(wrong.exit_code == 78);
  CHECK(Contains(wrong.output, ":2: feature = smell: one of finger friction, "));
}

TEST_CASE("haptic_lab report and people refuse what they cannot use") {
  const Ended cases = Run("report --cases rows.csv");
  CHECK(cases.exit_code == 64);
  CHECK(Contains(cases.output, "the report has its own rows"));
  CHECK(Run("report --shard 3/2").exit_code == 64);
  const Ended nobody = Run("people --out /no/such/folder");
  CHECK(nobody.exit_code == 78);
  CHECK(Contains(nobody.output, "/no/such/folder/people.csv: the table cannot be read"));
}

}  // namespace rikiseki::lab
