#include "ros/markers.h"

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <map>

#include "fragments/piece_colour.h"
#include "ros/conversions.h"
#include "ros/force_arrow.h"
#include "tools/tool_shapes.h"

namespace tissue_sim {
namespace {

using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

// The largest pieces, and no debris of a blade: they would hide them.
constexpr int kMostFragments = 64, kFewestPoints = 4;

std_msgs::ColorRGBA color(float r, float g, float b, float a = 1) {
  std_msgs::ColorRGBA c;
  c.r = r, c.g = g, c.b = b, c.a = a;
  return c;
}

std_msgs::ColorRGBA color(std::uint32_t rgb, float alpha) {
  return color(static_cast<float>(rgb >> 16 & 0xff) / 255,
               static_cast<float>(rgb >> 8 & 0xff) / 255, static_cast<float>(rgb & 0xff) / 255,
               alpha);
}

Marker marker(const MarkerInput& input, const std::string& ns, int id, int type) {
  Marker m;
  m.header.frame_id = input.frame;
  m.header.stamp = input.stamp;
  m.ns = ns;
  m.id = id;
  m.type = type;
  m.action = Marker::ADD;
  m.pose.orientation.w = 1;
  return m;
}

Marker deleted(const MarkerInput& input, const std::string& ns, int id) {
  Marker m = marker(input, ns, id, Marker::CUBE);
  m.action = Marker::DELETE;
  return m;
}

geometry_msgs::Vector3 scale(double x, double y, double z) { return to_vector3(Vec3(x, y, z)); }

void add_tool(const MarkerInput& input, std::size_t i, MarkerArray& array) {
  constexpr int kType[] = {Marker::CUBE, Marker::CYLINDER, Marker::SPHERE};
  int id = 0;
  for (const ToolShape& shape : tool_shapes(input.scene.tools[i], input.tools[i])) {
    Marker m = marker(input, input.scene.tools[i].name, id++, kType[shape.kind]);
    m.pose = to_pose(shape.pose);
    m.scale = to_vector3(shape.size);
    m.color = shape.is_handle ? color(0.25f, 0.27f, 0.30f) : color(0.75f, 0.78f, 0.82f);
    array.markers.push_back(m);
  }
}

void add_force(const MarkerInput& input, std::size_t i, MarkerArray& array) {
  const std::string ns = input.scene.tools[i].name + "/force";
  const Vec3 force = input.loads[i].mean.force;
  ForceArrow at;
  if (!place_force_arrow(input.scene.tools[i], input.tools[i].end, force, input.force_scale,
                         input.fragments, at)) {
    array.markers.push_back(deleted(input, ns, 0));
    array.markers.push_back(deleted(input, ns, 1));
    return;
  }
  Marker arrow = marker(input, ns, 0, Marker::ARROW);
  arrow.points = {to_point(at.start), to_point(at.end)};
  arrow.scale = scale(0.6 * at.unit, 1.5 * at.unit, 1.8 * at.unit);  // shaft, head, its length
  arrow.color = color(1.0f, 0.85f, 0.1f);
  array.markers.push_back(arrow);
  Marker text = marker(input, ns, 1, Marker::TEXT_VIEW_FACING);
  text.pose.position = to_point(at.label);
  text.scale.z = at.text_height;
  char newton[32];
  std::snprintf(newton, sizeof newton, "%.2f N", force.norm());
  text.text = newton;
  text.color = arrow.color;
  array.markers.push_back(text);
}

void add_fragment(const MarkerInput& input, const Fragment& f, int id, MarkerArray& array) {
  Marker box = marker(input, "fragments/box", id, Marker::LINE_LIST);
  box.scale.x = 0.0005;
  const std::uint32_t colour = piece_colour(f);
  box.color = color(colour, 0.8f);
  for (int corner = 0; corner < 8; ++corner) {
    const auto at = [&](int c) {
      return to_point(Vec3(c & 1 ? f.box.max.x() : f.box.min.x(),
                           c & 2 ? f.box.max.y() : f.box.min.y(),
                           c & 4 ? f.box.max.z() : f.box.min.z()));
    };
    for (const int axis : {1, 2, 4}) {
      if (corner & axis) continue;
      box.points.push_back(at(corner));
      box.points.push_back(at(corner | axis));
    }
  }
  array.markers.push_back(box);
  Marker label = marker(input, "fragments/label", id, Marker::TEXT_VIEW_FACING);
  // No larger than the piece, so that those of debris that lie together can be read.
  const Vec3 size = f.box.max - f.box.min;
  label.scale.z = std::max(0.002, std::min(0.006, 0.25 * std::max(size.x(), size.y())));
  label.pose.position =
      to_point(Vec3(f.centroid.x(), f.centroid.y(), f.box.max.z() + label.scale.z));
  char text[64];
  std::snprintf(text, sizeof text, "%d: %.2f cm3", f.id, f.volume * 1e6);
  label.text = text;
  label.color = color(tinted(colour, 0.4), 1);  // thin letters need more light than boxes
  array.markers.push_back(label);
}

}  // namespace

MarkerArray Markers::make(const MarkerInput& input) {
  MarkerArray array;
  if (first_) {  // RViz may still show another scene's
    array.markers.push_back(deleted(input, "", 0));
    array.markers.back().action = Marker::DELETEALL;
    first_ = false;
  }
  for (std::size_t i = 0; i < input.tools.size(); ++i) {
    if (!input.tools[i].present) continue;
    add_tool(input, i, array);
    if (i < input.loads.size()) add_force(input, i, array);
  }
  std::vector<const Fragment*> largest;
  for (const Fragment& f : input.fragments) {
    const bool placed = (f.box.min.array() <= f.box.max.array()).all();
    if (placed && f.point_count >= kFewestPoints) largest.push_back(&f);
  }
  std::sort(largest.begin(), largest.end(), [](const Fragment* a, const Fragment* b) {
    return a->point_count != b->point_count ? a->point_count > b->point_count : a->id < b->id;
  });
  const int shown = std::min<int>(kMostFragments, static_cast<int>(largest.size()));
  for (int i = 0; i < shown; ++i) add_fragment(input, *largest[i], i, array);
  for (int i = shown; i < fragments_shown_; ++i) {
    array.markers.push_back(deleted(input, "fragments/box", i));
    array.markers.push_back(deleted(input, "fragments/label", i));
  }
  fragments_shown_ = shown;
  return array;
}

Marker to_marker(const SurfaceTriangles& surface, Span<const Fragment> fragments) {
  Marker m;
  m.ns = "surface";
  m.type = Marker::TRIANGLE_LIST;
  m.pose.orientation.w = 1;
  m.scale = scale(1, 1, 1);
  m.color = color(1, 1, 1);
  m.action = surface.fragment.empty() ? Marker::DELETE : Marker::ADD;
  std::map<int, std_msgs::ColorRGBA> colours;
  for (const Fragment& f : fragments) {
    colours[f.id] = color(piece_colour(f), 1);
  }
  m.points.resize(3 * surface.fragment.size());
  m.colors.resize(m.points.size());
  for (std::size_t i = 0; i < m.points.size(); ++i) {
    m.points[i].x = surface.corners[3 * i];
    m.points[i].y = surface.corners[3 * i + 1];
    m.points[i].z = surface.corners[3 * i + 2];
    m.colors[i] = colours[surface.fragment[i / 3]];
  }
  return m;
}

}  // namespace tissue_sim
