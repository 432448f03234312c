// SPDX-License-Identifier: MIT
#include "world_server/physics/box_plane_contact.h"

namespace rikiseki::world {

// In the order of the copies' sites (contact_sites.cpp), which the sweeps of both follow.
std::vector<ContactPoint> FindBoxPlaneContact(const Box& box, const Pose& pose_WB,
                                              const Vec3& normal_W, double offset_m,
                                              double reach_m) {
  const Vec3 normal_B = pose_WB.orientation.conjugate() * normal_W;
  int axis = 0;
  normal_B.cwiseAbs().maxCoeff(&axis);
  std::vector<ContactPoint> points;
  for (const double sign_u : {-1, 1}) {
    for (const double sign_v : {-1, 1}) {
      Vec3 sign;
      sign[axis] = normal_B[axis] > 0 ? -1 : 1;
      sign[(axis + 1) % 3] = sign_u;
      sign[(axis + 2) % 3] = sign_v;
      const Vec3 corner = pose_WB * Vec3(sign.cwiseProduct(box.half_extents));
      const double gap = normal_W.dot(corner) - offset_m;
      if (gap <= reach_m) points.push_back({corner, normal_W, gap});
    }
  }
  return points;
}

}  // namespace rikiseki::world
