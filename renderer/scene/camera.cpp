// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/camera.h"

#include "renderer/scene/data/motion.h"

namespace braid {

Camera::Camera(const CameraData& data, int width, int height)
    : width_(static_cast<float>(width)), height_(static_cast<float>(height)), orthographic_(data.orthographic) {
  const Axes axes = axesOf(data.toWorld);
  position_ = axes.position;
  right_ = axes.right;
  up_ = axes.up;
  forward_ = axes.forward;
  if (!data.steps.empty()) steps_.push_back(axes);
  for (const Mat4& step : data.steps) steps_.push_back(axesOf(step));
  const float frameAspect = width_ / height_;
  halfHeight_ = orthographic_ ? data.ymag : std::tan(0.5f * data.yfov);
  halfWidth_ = halfHeight_ * frameAspect;
  if (!orthographic_ && data.lensRadius > 0) {
    lensRadius_ = data.lensRadius;
    focusDistance_ = data.focusDistance;
  }
}

Camera::Axes Camera::axesOf(const Mat4& toWorld) {
  const Mat3 rotation(toWorld);
  return {Vec3(toWorld[3]), glm::normalize(rotation[0]), glm::normalize(rotation[1]), -glm::normalize(rotation[2])};
}

// The directions in between are made orthogonal again, the view's first.
Camera Camera::at(float time) const {
  const Moment m = momentAt(time, steps_.size() - 1);
  const Axes &a = steps_[m.first], &b = steps_[m.first + 1];
  const Vec3 forward = between(a.forward, b.forward, m.fraction), right = between(a.right, b.right, m.fraction);
  Camera c;
  c.halfWidth_ = halfWidth_;
  c.halfHeight_ = halfHeight_;
  c.width_ = width_;
  c.height_ = height_;
  c.lensRadius_ = lensRadius_;
  c.focusDistance_ = focusDistance_;
  c.orthographic_ = orthographic_;
  c.position_ = between(a.position, b.position, m.fraction);
  const Vec3 up = glm::cross(right, forward);
  const bool defined = glm::length(forward) > 1e-3f && glm::length(up) > 1e-3f * glm::length(forward);
  c.forward_ = defined ? glm::normalize(forward) : a.forward;
  c.up_ = defined ? glm::normalize(up) : a.up;
  c.right_ = glm::cross(c.forward_, c.up_);
  return c;
}

Camera::CameraRay Camera::rayFrom(const Vec3& lensPoint, Vec2 raster) const {
  const float x = (2 * raster.x / width_ - 1) * halfWidth_;
  const float y = (1 - 2 * raster.y / height_) * halfHeight_;
  if (orthographic_) return {position_ + x * right_ + y * up_, forward_};
  const Vec3 towards = forward_ + x * right_ + y * up_;
  if (lensRadius_ <= 0) return {position_, glm::normalize(towards)};
  return {lensPoint, glm::normalize(focusDistance_ * towards - (lensPoint - position_))};
}

Vec3 Camera::lensPoint(Vec2 u) const {
  if (lensRadius_ <= 0) return position_;
  const float r = lensRadius_ * std::sqrt(u.x), phi = 2 * kPi * u.y;
  return position_ + r * std::cos(phi) * right_ + r * std::sin(phi) * up_;
}

std::optional<Vec2> Camera::projectFrom(const Vec3& lensPoint, const Vec3& point) const {
  Vec3 d = point - lensPoint;
  const float depth = glm::dot(d, forward_);
  if (!(depth > 0)) return std::nullopt;
  const float scale = orthographic_ ? 1.0f : 1.0f / depth;
  // Where the ray crosses the plane of focus, seen from the centre: similar triangles.
  if (lensRadius_ > 0) d += (depth / focusDistance_) * (lensPoint - position_);
  const float x = glm::dot(d, right_) * scale / halfWidth_;
  const float y = glm::dot(d, up_) * scale / halfHeight_;
  return Vec2(0.5f * (x + 1) * width_, 0.5f * (1 - y) * height_);
}

double Camera::pixelPdf(const Vec3& d) const {
  const double pixels = static_cast<double>(width_) * static_cast<double>(height_);
  const double perArea = pixels / static_cast<double>(frameArea());
  if (orthographic_) return perArea;
  const double cosine = static_cast<double>(glm::dot(d, forward_));
  return cosine > 0 ? perArea / (cosine * cosine * cosine) : 0.0;
}

Mat4 Camera::worldToCamera(const glm::dvec3& origin) const {
  Mat4 m(1);
  for (int i = 0; i < 3; ++i) m[i] = Vec4(right_[i], up_[i], -forward_[i], 0);
  m[3] = Vec4(-glm::dot(right_, position_), -glm::dot(up_, position_), glm::dot(forward_, position_), 1);
  if (origin != glm::dvec3(0)) {
    const glm::dmat3 rotation = glm::transpose(glm::dmat3(right_, up_, -forward_));
    m[3] = Vec4(-(rotation * (glm::dvec3(position_) + origin)), 1);
  }
  return m;
}

Mat4 Camera::worldToNdc(const glm::dvec3& origin) const {
  Mat4 projection(1);
  projection[0][0] = 1 / halfWidth_;
  projection[1][1] = 1 / halfHeight_;
  if (!orthographic_) {
    projection[2][2] = -1;
    projection[2][3] = -1;
    projection[3][3] = 0;
  }
  return projection * worldToCamera(origin);
}

}  // namespace braid
