// SPDX-License-Identifier: Apache-2.0
// Motion blur: closed forms of what moves on straight lines.
#include <doctest/doctest.h>

#include "tests/support/moving_scenes.h"
#include "tests/support/statistics/pass_means.h"

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
    data.cameras = {spotCamera({3, 1, 0}, {0, -2, 0}, 0.3f)};  // past the ball
    return data;
  };
  Settings settings = settingsFor(16, 16, 512);
  settings.integrators = {"bdpt"};
  const Measured open = meanOf(render(floorWith(false), settings)), half = meanOf(render(floorWith(true), settings));
  CHECK(half.value / open.value == doctest::Approx(0.75).epsilon(0.02));
}

}  // namespace braid::test_shutter
