// SPDX-License-Identifier: MIT
// What the world's queries cost: nearest points of each shape, the features of a mesh of 100 000
// triangles, and the planes among many bodies. Per query, p50 and p99:
//
//   world_bench --benchmark_enable_random_interleaving=true --benchmark_repetitions=5
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "tests/world_server/meshes.h"
#include "tests/world_server/scenes.h"
#include "world_server/features/nearest_mesh.h"
#include "world_server/features/planes.h"
#include "world_server/geometry/convex_hull.h"

namespace rikiseki::world {
namespace {

template <typename Query>
void Measure(benchmark::State& state, const std::vector<Vec3>& points, const Query& query) {
  std::vector<double> durations;
  std::size_t next = 0;
  for (auto _ : state) {
    const Vec3& p = points[next++ % points.size()];
    const auto start = std::chrono::steady_clock::now();
    query(p);
    const auto end = std::chrono::steady_clock::now();
    const double took_s = std::chrono::duration<double>(end - start).count();
    state.SetIterationTime(took_s);
    durations.push_back(took_s * 1e6);
  }
  std::sort(durations.begin(), durations.end());
  const auto quantile = [&](double q) {
    return durations[static_cast<std::size_t>(q * static_cast<double>(durations.size() - 1))];
  };
  state.counters["p50_us"] = quantile(0.5);
  state.counters["p99_us"] = quantile(0.99);
}

// As a finger meets a surface: within a few millimetres of it, on either side.
std::vector<Vec3> NearSurface(const TriangleMesh& mesh, double within) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<Vec3> points;
  for (int i = 0; i < 4096; ++i) {
    const TriangleMesh::Face& face = mesh.faces()[random() % mesh.faces().size()];
    points.push_back(mesh.corners()[face.corners[0]] + within * uniform(random) * face.normal);
  }
  return points;
}

// A torus with bumps, 20 cm across, of about 100 000 triangles.
const TriangleMesh& Large() {
  static const TriangleMesh kMesh = [] {
    test::RawMesh raw = test::Torus(0.07, 0.03, 320, 156);
    for (Vec3& c : raw.corners) c *= 1 + 0.02 * std::sin(200 * c.x()) * std::cos(200 * c.y());
    return test::Build(raw);
  }();
  return kMesh;
}

void NearestOfMesh(benchmark::State& state) {
  const double within = 1e-3 * static_cast<double>(state.range(0));
  Measure(state, NearSurface(Large(), within),
          [](const Vec3& p) { benchmark::DoNotOptimize(FindNearest(Large(), p)); });
  state.counters["triangles"] = static_cast<double>(Large().faces().size());
}

void FeaturesOfMesh(benchmark::State& state) {
  const double radius = 1e-3 * static_cast<double>(state.range(0));
  std::vector<NearestPoint> found;
  Measure(state, NearSurface(Large(), 0.005), [&](const Vec3& p) {
    FindMeshFeatures(Large(), p, radius, found);
    benchmark::DoNotOptimize(found.data());
  });
}

void NearestOfHull(benchmark::State& state) {
  std::mt19937 random(2);
  std::normal_distribution<double> normal;
  std::vector<Vec3> points;
  for (int i = 0; i < state.range(0); ++i) {
    points.push_back(0.05 * Vec3(normal(random), normal(random), normal(random)).normalized());
  }
  const TriangleMesh hull = ConvexHull(points);
  Measure(state, NearSurface(hull, 0.01),
          [&](const Vec3& p) { benchmark::DoNotOptimize(FindNearest(hull, p)); });
}

// One finger among cubes 5 cm apart, all fixed or all free.
void PlanesAmongBodies(benchmark::State& state) {
  const auto count = static_cast<int>(state.range(0));
  Scene scene;
  const int side = static_cast<int>(std::ceil(std::cbrt(count)));
  for (int i = 0; i < count; ++i) {
    scene.bodies.push_back(
        test::Cube(0.02, 0.1, 0.3, 0.05 * Vec3(i % side, i / side % side, i / side / side)));
    scene.bodies.back().fixed = state.range(1) != 0;
  }
  std::vector<BodyState> states;
  for (const SceneBody& body : scene.bodies) states.push_back({.pose = body.pose_WB});
  const std::vector<std::uint32_t> generations(scene.bodies.size(), 1);
  std::vector<Vec3> points;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(0, 0.05 * side);
  for (int i = 0; i < 4096; ++i) {
    points.push_back({uniform(random), uniform(random), uniform(random)});
  }
  PlaneFinder finder(scene);
  std::array<protocol::Plane, protocol::kMaxPlanes> planes;
  Measure(state, points, [&](const Vec3& p) {
    const Finger finger{.pointer = 0, .radius_m = 0.01, .position = p};
    benchmark::DoNotOptimize(finder.Find(states, generations, {&finger, 1},
                                         {.radius_m = 0.02, .period_s = 0.05}, planes));
  });
}

BENCHMARK(NearestOfMesh)->Arg(1)->Arg(10)->Arg(50)->UseManualTime()->Unit(benchmark::kMicrosecond);
BENCHMARK(FeaturesOfMesh)
    ->Arg(10)
    ->Arg(30)
    ->Arg(100)
    ->UseManualTime()
    ->Unit(benchmark::kMicrosecond);
BENCHMARK(NearestOfHull)->Arg(20)->Arg(200)->UseManualTime()->Unit(benchmark::kMicrosecond);
BENCHMARK(PlanesAmongBodies)
    ->ArgsProduct({{10, 100, 1000, 10000}, {0, 1}})
    ->UseManualTime()
    ->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace rikiseki::world

BENCHMARK_MAIN();
