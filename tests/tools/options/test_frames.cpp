// SPDX-License-Identifier: Apache-2.0
// Ranges of frames, the names of their files, and cameras that turn.
#include <doctest/doctest.h>

#include "renderer/core/error.h"
#include "tools/options/frames.h"
#include "tools/options/turntable.h"

namespace braid::test_frames {

TEST_CASE("Ranges of frames are read, wrong ones refused") {
  CHECK(parseFrames("0:24") == FrameRange{0, 24, 1});
  CHECK(parseFrames("5:20:4") == FrameRange{5, 20, 4});
  CHECK(parseFrames("5:20:4").count() == 4);
  CHECK(parseFrames("5:20:4").at(3) == 17);
  CHECK(parseFrames("0:1000000").count() == 1000000);
  for (const char* wrong : {"", "5", "5:", ":5", "5:5", "6:5", "0:24:", "0:24:0", "0:24:-1", "-1:5", "0:24:1:1", "a:b",
                            "0 :5", "0:1000001", "0:5x", "1.5:3", "0:99999999999999999999"}) {
    INFO(wrong);
    CHECK_THROWS_AS(parseFrames(wrong), Error);
  }
}

TEST_CASE("Frames have numbers in the names of their files") {
  CHECK(withFrameNumber("out_####.exr", 7) == "out_0007.exr");
  CHECK(withFrameNumber("out_##.exr", 12345) == "out_12345.exr");
  CHECK(withFrameNumber("#", 3) == "3");
  CHECK(withFrameNumber("take #2/out.##", 3) == "take #2/out.03");
  CHECK(withFrameNumber("out_%04d.exr", 42) == "out_0042.exr");
  CHECK(withFrameNumber("100% of %d.exr", 42) == "100% of 42.exr");
  CHECK(withFrameNumber("out.exr", 42) == "out.exr");
  CHECK(withFrameNumber("", 42) == "");
  CHECK(holdsFrameNumber("a#"));
  CHECK(holdsFrameNumber("a%03d"));
  for (const char* none : {"", "a", "%", "%x", "100%", "%1234d"}) CHECK_FALSE(holdsFrameNumber(none));
}

TEST_CASE("Frames play a clip at its rate; a turntable shows one pose unless it is told a rate") {
  FrameChoice frames;
  CHECK_FALSE(frames.any());
  frames.range = FrameRange{0, 48, 1};
  CHECK(frames.plays());
  CHECK(frames.timeOf(36) == 1.5);
  frames.framesPerSecond = 25;
  CHECK(frames.timeOf(1) == 0.04);
  CHECK_THROWS_AS(checkFrames(frames, true), Error);
  frames = {};
  frames.turntable = 12;
  CHECK(frames.frames() == FrameRange{0, 12, 1});
  CHECK_FALSE(frames.plays());
  checkFrames(frames, true);
  frames.framesPerSecond = 24;
  CHECK_THROWS_AS(checkFrames(frames, false), Error);
  frames.range = FrameRange{0, 6, 1};
  CHECK(frames.plays());
  checkFrames(frames, false);
  CHECK_THROWS_AS(checkFrames(frames, true), Error);
}

TEST_CASE("A turned camera keeps its distance from the axis, its height and what it looks at") {
  CameraData camera;
  camera.toWorld = glm::inverse(glm::lookAt(Vec3(5, 2, 1), Vec3(1, 1, 1), Vec3(0, 1, 0)));
  const Mat4 before = camera.toWorld;
  const glm::dvec3 axis(101, 50, 1), origin(100, 50, 0);
  turnAbout(axis, origin, 0, camera);
  CHECK(camera.toWorld == before);
  turnAbout(axis, origin, 0.25, camera);
  CHECK(glm::length(Vec3(camera.toWorld[3]) - Vec3(1, 2, -3)) < 1e-5f);
  const Vec3 ahead = -Vec3(camera.toWorld[2]);
  CHECK(glm::length(ahead - glm::normalize(Vec3(1, 1, 1) - Vec3(1, 2, -3))) < 1e-5f);
}

}  // namespace braid::test_frames
