#include "ros/fluid_output.h"

#include <cstddef>

#include "fluid/fill.h"

namespace tissue_sim {

void FluidOutput::send_points(Simulation& simulation, const std_msgs::Header& header,
                              bool into_bag) const {
  points_.send(into_bag, header.stamp, [&] {
    using sensor_msgs::PointField;
    auto m = boost::make_shared<sensor_msgs::PointCloud2>();
    m->header = header;
    m->height = 1;
    m->width = static_cast<std::uint32_t>(simulation.tissue().read_fluid(m->data));
    m->point_step = sizeof(FluidPoint);
    m->row_step = m->point_step * m->width;
    m->is_bigendian = false;
    m->is_dense = true;
    const auto add = [&m](const char* name, std::size_t offset, std::uint8_t type) {
      PointField field;
      field.name = name;
      field.offset = static_cast<std::uint32_t>(offset);
      field.datatype = type;
      field.count = 1;
      m->fields.push_back(field);
    };
    add("x", offsetof(FluidPoint, x), PointField::FLOAT32);
    add("y", offsetof(FluidPoint, y), PointField::FLOAT32);
    add("z", offsetof(FluidPoint, z), PointField::FLOAT32);
    add("rgb", offsetof(FluidPoint, rgb), PointField::FLOAT32);  // the bits, as PCL reads them
    add("vx", offsetof(FluidPoint, vx), PointField::FLOAT32);
    add("vy", offsetof(FluidPoint, vy), PointField::FLOAT32);
    add("vz", offsetof(FluidPoint, vz), PointField::FLOAT32);
    add("pressure", offsetof(FluidPoint, pressure), PointField::FLOAT32);
    add("fluid", offsetof(FluidPoint, fluid), PointField::UINT32);
    add("id", offsetof(FluidPoint, id), PointField::UINT32);
    return m;
  });
}

void FluidOutput::send_amounts(Simulation& simulation, const std_msgs::Header& header,
                               bool into_bag) const {
  amounts_.send(into_bag, header.stamp, [&] {
    auto m = boost::make_shared<FluidArray>();
    m->header = header;
    m->frame = simulation.frame();
    m->time = simulation.time();
    const Scene& scene = simulation.scene();
    const std::vector<Fluid> kinds = fluid_kinds(scene);
    const std::vector<FluidVolume> volumes = simulation.tissue().fluid_volumes();
    for (std::size_t i = 0; i < volumes.size(); ++i) {
      FluidAmount amount;
      amount.name = kinds[i].name;
      amount.total = volumes[i].total;
      for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
        if (!(volumes[i].inside[b] > 0)) continue;
        amount.bodies.push_back(scene.bodies[b].name);
        amount.inside.push_back(volumes[i].inside[b]);
      }
      amount.spilt = volumes[i].spilt;
      amount.lost = volumes[i].lost;
      amount.pressure = volumes[i].pressure;
      amount.sucked = volumes[i].sucked;
      amount.drained = volumes[i].drained;
      amount.bled = volumes[i].bled;
      amount.irrigated = volumes[i].irrigated;
      amount.bleeding = volumes[i].bleeding;
      m->fluids.push_back(amount);
    }
    return m;
  });
}

}  // namespace tissue_sim
