// SPDX-License-Identifier: Apache-2.0
// Motion blur: closed forms of what moves on straight lines, and all integrators on one scene of which everything
// moves.
#include <doctest/doctest.h>

#include "tests/support/moving_scenes.h"
#include "tests/support/pass_means.h"

namespace braid::test_shutter {

using namespace test;

namespace {

constexpr int kWidth = 40, kHeight = 4;

// Sees [-1, 1] along x.
CameraData strip() {
  CameraData camera = spotCamera({0, 0, 3}, Vec3(0), 0.1f);
  camera.xmag = 1;
  return camera;
}

// A lamp of radiance 1, 0.3 wide, that starts at x = -0.7.
SceneData movingLamp(const std::vector<Vec3>& ways, Moved how) {
  SceneData data;
  data.materials.push_back(diffuseMaterial(Spectrum(0), Spectrum(1)));
  TriangleMesh lamp;
  addQuad(lamp, {-0.7f, -1, 0}, {0.3f, 0, 0}, {0, 2, 0});
  data.motion = evenMotion(ways.size() - 1);
  addMoving(data, std::move(lamp), 0, ways, how);
  data.cameras = {strip()};
  return data;
}

// The largest distance of columns of the image from expected values, over what chance leaves once in 10,000 times.
double worstColumn(const RenderResult& r, const std::vector<double>& expected) {
  double worst = 0;
  for (int x = 0; x < kWidth; ++x) {
    const Measured m = meanOver(r, 1, {x, 0, x + 1, kHeight});
    const double e = expected[static_cast<size_t>(x)];
    // Where only a hit in 40,000 is expected, all or none may be seen.
    const double least = std::sqrt(std::max(e * (1 - e), 1e-4) / (kHeight * static_cast<double>(estimateOf(r).passes)));
    worst = std::max(worst, std::fabs(m.value - e) / std::max(m.error, least));
  }
  return worst / zLimit(kWidth);
}

std::vector<double> columns(double left, double right, double way) {
  std::vector<double> expected;
  for (int x = 0; x < kWidth; ++x)
    expected.push_back(pixelCoverage(-1 + 2.0 * x / kWidth, -1 + 2.0 * (x + 1) / kWidth, left, right, way));
  return expected;
}

Settings stripSettings(const char* integrator, uint64_t spp) {
  Settings settings = settingsOf(integrator, kWidth, kHeight, spp);
  settings.maxDepth = 2;
  return settings;
}

}  // namespace

TEST_CASE("Shutter: what moves on a line covers pixels for the time of the closed form") {
  const std::vector<double> expected = columns(-0.7, -0.4, 1);
  for (const Moved how : {Moved::ByVertices, Moved::ByInstance, Moved::ByInstances}) {
    const Scene scene(movingLamp({Vec3(0), Vec3(1, 0, 0)}, how));
    CHECK(scene.instances().size() == (how == Moved::ByVertices ? 0 : how == Moved::ByInstance ? 1 : 2));
    for (const char* name : {"pt", "bdpt", "crn", "gdpt"}) {
      CAPTURE(std::string(name));
      const double worst = worstColumn(render(scene, stripSettings(name, 1024)), expected);
      MESSAGE(std::string(name), ": ", worst, " of the limit");
      CHECK(worst < 1);
    }
  }
  // A pass of these is one instant for all pixels, so that columns of 4 pixels count once.
  for (const char* name : {"sppm", "vcm"}) {
    const std::vector<Measured> means =
        passMeans(Scene(movingLamp({Vec3(0), Vec3(1, 0, 0)}, Moved::ByInstance)), stripSettings(name, 1024), kHeight);
    double worst = 0;
    for (size_t block = 0; block < kWidth / kHeight; ++block) {
      double e = 0;
      for (size_t x = block * kHeight; x < (block + 1) * kHeight; ++x) e += expected[x] / kHeight;
      worst = std::max(worst, std::fabs(means[3 * block + 1].value - e) / std::max(means[3 * block + 1].error, 1e-3));
    }
    MESSAGE(std::string(name), ": ", worst, " standard errors");
    CHECK(worst / zLimit(kWidth / kHeight) < 1);
  }
}

TEST_CASE("Shutter: steps at uneven times, and jumps, take the time that they are given") {
  // Rests for half of the time, is elsewhere at once, and moves from there.
  SceneData data = movingLamp({Vec3(0), Vec3(0), Vec3(0.6f, 0, 0), Vec3(1.2f, 0, 0)}, Moved::ByInstance);
  data.motion.times = {0, 0.5f, 0.5f, 1};
  const std::vector<double> rest = columns(-0.7, -0.4, 1e-9), moved = columns(-0.1, 0.2, 0.6);
  std::vector<double> expected;
  for (size_t x = 0; x < rest.size(); ++x) expected.push_back(0.5 * rest[x] + 0.5 * moved[x]);
  CHECK(worstColumn(render(std::move(data), stripSettings("pt", 1024)), expected) < 1);
}

TEST_CASE("Shutter: times are spread evenly over the seconds, and never fall into a jump") {
  SceneMotion motion;
  CHECK(shutterTime(motion, 0.7f) == 0);
  motion.times = {0, 0.25f, 0.25f, 1};
  CHECK(shutterTime(motion, 0) == 0);
  CHECK(shutterTime(motion, 0.125f) == doctest::Approx(0.5 / 3));
  CHECK(shutterTime(motion, 0.25f) == doctest::Approx(2.0 / 3));
  CHECK(shutterTime(motion, 0.625f) == doctest::Approx(2.5 / 3));
  for (int i = 0; i < 1000; ++i) {
    const float time = shutterTime(motion, static_cast<float>(i) / 1000) * 3;
    CHECK((time <= 1.00001f || time >= 1.99999f));
  }
  for (const std::vector<float>& times : {std::vector<float>{0, 0, 1}, {0, 1, 1}}) {
    motion.times = times;
    for (const float share : {0.0f, 0.5f, kOneMinusEpsilon}) {
      const float time = shutterTime(motion, share);
      CHECK(time >= 0);
      CHECK(time <= 1);
    }
  }
}

TEST_CASE("Shutter: crn and pt show no strobe: few samples of neighbours are at other times") {
  const Scene scene(movingLamp({Vec3(0), Vec3(1, 0, 0)}, Moved::ByInstance));
  for (const char* name : {"pt", "crn"}) {
    Settings settings = stripSettings(name, 4);
    settings.height = 64;
    const RenderResult r = render(scene, settings);
    // Within a column of one expectation, pixels are not alike.
    const Rgb<float>& image = estimateOf(r).mean;
    int alike = 0;
    for (int y = 0; y + 1 < settings.height; ++y) alike += image[1].at(kWidth / 2, y) == image[1].at(kWidth / 2, y + 1);
    MESSAGE(std::string(name), ": ", alike, " of 63 neighbours are equal");
    CHECK(alike < 45);
  }
}

namespace {

// A box with a lens, of which a sphere, the lamp, a point light and the camera move, at `times` of the shutter: all of
// them, or one alone.
SceneData movingBox() {
  SceneData data = cornellBox();
  TriangleMesh sphere;
  addSphere(sphere, {-0.35f, 0.1f, 0.6f}, 0.25f, 2);
  Material red = data.materials[0];
  red.baseColor = Spectrum(0.8f, 0.2f, 0.1f);
  data.materials.push_back(red);
  data.motion = evenMotion(2);
  addMoving(data, std::move(sphere), static_cast<uint32_t>(data.materials.size() - 1),
            {Vec3(0), Vec3(0.4f, 0.1f, 0), Vec3(0.6f, 0.3f, -0.2f)}, Moved::ByVertices);
  // The lamp sinks, and grows.
  TriangleMesh& lamp = data.meshes[4];
  for (const float k : {1.0f, 2.0f}) {
    MeshVertices step = lamp;
    for (Vec3& p : step.positions) p = Vec3(p.x * (1 - 0.3f * k), p.y - 0.15f * k, p.z);
    lamp.steps.push_back(std::move(step));
  }
  // A second, small one turns.
  TriangleMesh small;
  addQuad(small, {-0.1f, 0, -0.1f}, {0.2f, 0, 0}, {0, 0, 0.2f});
  addMesh(data, std::move(small), 3);
  const Mat4 at = glm::translate(Mat4(1), Vec3(0.6f, 0.3f, 0));
  MeshInstance& turning = data.instances.back();
  turning.toWorld = at;
  for (const float angle : {0.5f, 1.2f}) turning.steps.push_back(glm::rotate(at, angle, Vec3(0, 0, 1)));
  PunctualLight light;
  light.kind = PunctualKind::Spot;
  light.outerConeAngle = 0.9f;
  light.intensity = Spectrum(1.5f);
  light.position = {-0.7f, 0.7f, 0.8f};
  light.direction = {0, -1, 0};
  light.steps = {{{-0.3f, 0.7f, 0.8f}, glm::normalize(Vec3(0.4f, -1, 0))},
                 {{0.3f, 0.6f, 0.8f}, glm::normalize(Vec3(0, -1, -0.5f))}};
  data.lights.push_back(light);
  CameraData& camera = data.cameras[0];
  camera.steps = {glm::translate(camera.toWorld, Vec3(0.1f, 0, -0.1f)),
                  glm::rotate(glm::translate(camera.toWorld, Vec3(0.2f, 0.1f, -0.1f)), 0.06f, Vec3(0, 1, 0))};
  camera.lensRadius = 0.05f;
  camera.focusDistance = 3.5f;
  return data;
}

SceneData stoppedBox() {
  SceneData data = movingBox();
  for (TriangleMesh& mesh : data.meshes) mesh.steps.clear();
  for (MeshInstance& instance : data.instances) instance.steps.clear();
  data.lights[0].steps.clear();
  data.cameras[0].steps.clear();
  data.motion = {};
  return data;
}

constexpr int kSeeds = 16, kBlock = 6, kSide = 36;

// As tests/scene/test_lens.cpp: means over blocks, with their standard errors over renders of different seeds.
std::vector<Measured> blockMeans(const Scene& scene, const char* integrator, uint64_t spp, uint64_t firstSeed) {
  Settings settings = settingsFor(kSide, kSide, spp);
  settings.integrators = {integrator};
  settings.photonRadius = 1;
  std::vector<double> sum(36), squares(36);
  for (uint64_t k = 0; k < kSeeds; ++k) {
    settings.seed = firstSeed + k;
    const RenderResult r = render(scene, settings);
    const std::vector<PixelWindow> blocks = blocksOf(r, kBlock);
    for (size_t b = 0; b < blocks.size(); ++b) {
      const double mean = meanOver(r, 1, blocks[b]).value;
      sum[b] += mean / kSeeds;
      squares[b] += sqr(mean) / kSeeds;
    }
  }
  std::vector<Measured> means;
  for (size_t b = 0; b < sum.size(); ++b)
    means.push_back({sum[b], std::sqrt(std::max(0.0, squares[b] - sqr(sum[b])) / (kSeeds - 1))});
  return means;
}

double worst(const std::vector<Measured>& a, const std::vector<Measured>& b, double bias) {
  double z = 0;
  for (size_t i = 0; i < a.size(); ++i)
    z = std::max(z, (std::fabs(a[i].value - b[i].value) - bias * b[i].value) / std::hypot(a[i].error, b[i].error));
  return z;
}

}  // namespace

// Student's t of 15 degrees of freedom and more exceeds 7 once in 200,000: over 36 blocks and 5 integrators a false
// alarm in 1,000 choices of seeds. Photons and merging blur: 2 % are forgiven there.
TEST_CASE("Shutter: all integrators see the same box, of which everything moves") {
  const Scene scene(movingBox()), stopped(stoppedBox());
  CHECK(scene.moves());
  const std::vector<Measured> pt = blockMeans(scene, "pt", 32, 1000);
  CHECK(worst(blockMeans(stopped, "pt", 32, 2000), pt, 0) > 20);
  const std::tuple<const char*, uint64_t, double> others[] = {
      {"bdpt", 16, 0.0}, {"crn", 32, 0.0}, {"gdpt", 16, 0.0}, {"vcm", 16, 0.02}, {"sppm", 32, 0.02}};
  for (const auto& [name, spp, bias] : others) {
    const double z = worst(blockMeans(scene, name, spp, 1), pt, bias);
    MESSAGE(std::string(name), ": largest difference from pt ", z, " standard errors");
    CHECK(z < 7);
  }
}

TEST_CASE("Shutter: the mean of stills at even times is the picture of the open shutter") {
  // Every still stands where the moving scene is at its time.
  const auto stillAt = [](float time) {
    SceneData data = movingBox();
    for (TriangleMesh& mesh : data.meshes) {
      if (!mesh.moves()) continue;
      const Moment m = momentAt(time, 2);
      const MeshVertices a = mesh.step(m.first), b = mesh.step(m.first + 1);
      for (size_t i = 0; i < a.positions.size(); ++i)
        mesh.positions[i] = between(a.positions[i], b.positions[i], m.fraction);
      for (size_t i = 0; i < a.normals.size(); ++i) mesh.normals[i] = between(a.normals[i], b.normals[i], m.fraction);
      mesh.steps.clear();
    }
    for (MeshInstance& i : data.instances) {
      if (i.steps.empty()) continue;
      i.toWorld =
          time < 0.5f ? between(i.toWorld, i.steps[0], 2 * time) : between(i.steps[0], i.steps[1], 2 * time - 1);
      i.steps.clear();
    }
    const LightPlace place = placeAt(data.lights[0], time);
    data.lights[0].position = place.position;
    data.lights[0].direction = place.direction;
    data.lights[0].steps.clear();
    CameraData& camera = data.cameras[0];
    const Camera at = Camera(camera, kSide, kSide).at(time);
    camera.toWorld = glm::inverse(at.worldToCamera());
    camera.steps.clear();
    data.motion = {};
    return data;
  };
  const Scene scene(movingBox());
  const std::vector<Measured> blurred = blockMeans(scene, "pt", 32, 5000);
  // A time at random within each of 32 parts, anew for each of the seeds.
  constexpr int kStills = 32;
  std::vector<double> sum(36), squares(36);
  Rng rng(11);
  for (uint64_t k = 0; k < kSeeds; ++k) {
    std::vector<double> mean(36);
    for (int i = 0; i < kStills; ++i) {
      const Scene still(stillAt((static_cast<float>(i) + rng.next()) / kStills));
      Settings settings = settingsFor(kSide, kSide, 4);
      settings.seed = 100 * k + static_cast<uint64_t>(i);
      const RenderResult r = render(still, settings);
      const std::vector<PixelWindow> blocks = blocksOf(r, kBlock);
      for (size_t b = 0; b < blocks.size(); ++b) mean[b] += meanOver(r, 1, blocks[b]).value / kStills;
    }
    for (size_t b = 0; b < mean.size(); ++b) {
      sum[b] += mean[b] / kSeeds;
      squares[b] += sqr(mean[b]) / kSeeds;
    }
  }
  std::vector<Measured> stills;
  for (size_t b = 0; b < sum.size(); ++b)
    stills.push_back({sum[b], std::sqrt(std::max(0.0, squares[b] - sqr(sum[b])) / (kSeeds - 1))});
  const double z = worst(stills, blurred, 0);
  MESSAGE("largest difference ", z, " standard errors");
  CHECK(z < 7);
}

TEST_CASE("Shutter: features are means over the same times, and nothing depends on threads") {
  SceneData data = movingLamp({Vec3(0), Vec3(1, 0, 0)}, Moved::ByInstance);
  data.materials[0] = diffuseMaterial(Spectrum(0.5f));
  EnvironmentData sky;
  sky.radiance = Spectrum(1);
  data.environment = sky;
  const Scene scene(std::move(data));
  Settings settings = stripSettings("pt", 512);
  settings.keep.features = true;
  settings.transparent = true;
  settings.threads = 1;
  const RenderResult one = render(scene, settings);
  const std::vector<double> expected = columns(-0.7, -0.4, 1);
  const Estimates& e = *one.estimates;
  for (int x = 0; x < kWidth; ++x) {
    double depth = 0, albedo = 0;
    for (int y = 0; y < kHeight; ++y) {
      depth += static_cast<double>(e.features->depth.mean.at(x, y)) / kHeight;
      albedo += static_cast<double>(e.features->albedo.mean[0].at(x, y)) / kHeight;
    }
    // The lens sees the plane at 3 m, or the sky, of which the albedo is 1 and the depth 0.
    const double share = expected[static_cast<size_t>(x)], error = std::sqrt(share * (1 - share) / 2048) + 1e-4;
    CHECK(std::fabs(depth / 3 - share) < 5 * error);
    CHECK(std::fabs((1 - albedo) / 0.5 - share) < 5 * error);
  }
  settings.threads = 3;
  CHECK(sameBits(estimateOf(one), estimateOf(render(scene, settings))));
}

TEST_CASE("Shutter: what passes through the camera is seen on both sides of it, and nothing is rejected") {
  SceneData data = movingLamp({Vec3(0, 0, -1), Vec3(0, 0, 7)}, Moved::ByVertices);
  data.materials[0].doubleSided = true;
  for (MeshVertices* v : {static_cast<MeshVertices*>(&data.meshes[0]), &data.meshes[0].steps[0]})
    for (Vec3& p : v->positions) p = Vec3(p.x < -0.5f ? -500.0f : 500.0f, 50 * p.y, p.z);
  data.cameras[0].orthographic = false;
  const RenderResult r = render(std::move(data), stripSettings("pt", 256));
  CHECK(r.rejected == 0);
  // It is before the camera for half of the time.
  const Measured mean = meanOf(r);
  CHECK(zScore(mean, 0.5) < kSigmas);
}

namespace {

// A ball of tinted air, a metre of which leaves a half, that is about the origin for half of the time only.
void addPassingBall(SceneData& data) {
  Material tinted = diffuseMaterial(Spectrum(1));
  tinted.transmission = 1;
  tinted.thinWalled = false;
  tinted.ior = 1;
  tinted.roughness = 0;
  tinted.attenuationDistance = 1;
  tinted.attenuationColor = Spectrum(0.5f);
  data.materials.push_back(tinted);
  TriangleMesh ball;
  addSphere(ball, Vec3(0), 1, 4);
  ball.normals.clear();
  data.motion = {.seconds = 1, .times = {0, 0.5f, 0.5f, 1}, .error = 0};
  const Vec3 away(0, 0, 60);
  addMoving(data, std::move(ball), static_cast<uint32_t>(data.materials.size() - 1), {Vec3(0), Vec3(0), away, away},
            Moved::ByInstance);
}

}  // namespace

TEST_CASE("Shutter: a solid that comes to the camera, or to a lamp, is around it for its time only") {
  SceneData wall;
  wall.materials.push_back(diffuseMaterial(Spectrum(0), Spectrum(1)));
  TriangleMesh lamp;
  addQuad(lamp, {-20, -20, -3}, {40, 0, 0}, {0, 40, 0});
  addMesh(wall, std::move(lamp), 0);
  addPassingBall(wall);
  wall.cameras = {CameraData{}};
  const Scene seen(std::move(wall));
  for (const char* name : {"pt", "bdpt", "vcm", "sppm", "gdpt"}) {
    CAPTURE(std::string(name));
    Settings settings = settingsFor(8, 8, 1024);
    settings.integrators = {name};
    CHECK(meanOf(render(seen, settings)).value == doctest::Approx(0.75).epsilon(0.01));
  }

  // A point light that the ball is around for half of the time, above a floor: only light paths find it then.
  const auto floorWith = [](bool ball) {
    SceneData data;
    data.materials.push_back(diffuseMaterial(Spectrum(0.5f)));
    TriangleMesh floor;
    addQuad(floor, {-2, -2, 2}, {4, 0, 0}, {0, 0, -4});
    addMesh(data, std::move(floor), 0);
    if (ball) addPassingBall(data);
    PunctualLight light;
    light.intensity = Spectrum(10);
    data.lights.push_back(light);
    data.cameras = {spotCamera({3, 1, 0}, {0, -2, 0}, 0.8f)};
    return data;
  };
  Settings settings = settingsFor(16, 16, 512);
  settings.integrators = {"bdpt"};
  const Measured open = meanOf(render(floorWith(false), settings)), half = meanOf(render(floorWith(true), settings));
  CHECK(half.value / open.value == doctest::Approx(0.75).epsilon(0.02));
}

}  // namespace braid::test_shutter
