// SPDX-License-Identifier: Apache-2.0
// Perspective (pinhole or thin lens) and orthographic cameras: rays, importance, and the projection of a point onto the
// raster.
#pragma once

#include <optional>
#include <vector>

#include "renderer/core/vec.h"
#include "renderer/scene/data/scene_data.h"

namespace braid {

class Camera {
 public:
  Camera() = default;
  // `width` × `height` is the full frame in pixels. A camera with its own aspect ratio keeps its vertical extent; the
  // horizontal one follows the frame's aspect, as glTF leaves to the renderer.
  Camera(const CameraData& data, int width, int height);

  struct CameraRay {
    Vec3 origin, direction;  // direction is unit
    float time = 0;          // of its path
  };
  // Ray through the raster position (pixel centres at +0.5): of a pinhole, or through the centre of the lens.
  CameraRay ray(Vec2 raster) const { return rayFrom(position_, raster); }
  // The same from a point of the lens, toward the point of the plane of focus that the centre sees there.
  CameraRay rayFrom(const Vec3& lensPoint, Vec2 raster) const;
  // A point of the lens, uniform on its disk for uniform u; of a pinhole the one that there is.
  Vec3 lensPoint(Vec2 u) const;

  // The raster position at which the centre, or a point of the lens, sees a world point, or none behind the camera.
  // Does not test against the frame.
  std::optional<Vec2> project(const Vec3& point) const { return projectFrom(position_, point); }
  std::optional<Vec2> projectFrom(const Vec3& lensPoint, const Vec3& point) const;

  // Density with which rays through one pixel, uniform on it, take the direction of the unit vector d: per steradian
  // (perspective), or per m² on the sensor (orthographic). 0 behind the camera. The same from every point of the lens,
  // as all see the same frame on the plane of focus.
  double pixelPdf(const Vec3& d) const;

  // Whether it moves while the shutter is open. All else here is what it is at the opening, or at the time of at().
  bool moves() const { return !steps_.empty(); }
  Camera at(float time) const;

  float lensRadius() const { return lensRadius_; }  // metres; 0: pinhole
  float focusDistance() const { return focusDistance_; }
  bool orthographic() const { return orthographic_; }
  Vec3 position() const { return position_; }
  Vec3 forward() const { return forward_; }
  // Area of the frame on the plane at distance 1 (perspective) or on the sensor (orthographic), in m².
  float frameArea() const { return 4 * halfWidth_ * halfHeight_; }
  // For points in coordinates in which the scene's zero lies at `origin` (SceneData::origin).
  Mat4 worldToCamera(const glm::dvec3& origin = glm::dvec3(0)) const;
  Mat4 worldToNdc(const glm::dvec3& origin = glm::dvec3(0)) const;

 private:
  struct Axes {
    Vec3 position{0}, right{1, 0, 0}, up{0, 1, 0}, forward{0, 0, -1};
  };
  static Axes axesOf(const Mat4& toWorld);

  Vec3 position_{0}, right_{1, 0, 0}, up_{0, 1, 0}, forward_{0, 0, -1};
  float halfWidth_ = 1, halfHeight_ = 1;  // of the frame at distance 1, or of the sensor
  float width_ = 1, height_ = 1;
  float lensRadius_ = 0, focusDistance_ = 1;
  bool orthographic_ = false;
  std::vector<Axes> steps_;  // 0, 1, … of the scene's motion; empty: it stands still
};

// A camera at a time, without a copy of one that stands still.
class CameraAt {
 public:
  CameraAt(const Camera& camera, float time) : still_(camera) {
    if (camera.moves()) moved_ = camera.at(time);
  }
  const Camera& operator*() const { return moved_ ? *moved_ : still_; }
  const Camera* operator->() const { return &**this; }

 private:
  const Camera& still_;
  std::optional<Camera> moved_;
};

}  // namespace braid
