// Objects standing on the table: connected components of the organised cloud above the plane.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "segmentation/plane.h"

namespace vantage::segmentation {

struct ClusterParams {
  double min_height_m = 0.01;  // Above the plane; > 0.
  double max_height_m = 0.6;   // > min_height_m.
  double max_jump_m =
      0.015;  // Neighbouring pixels further apart in depth belong to different objects, at 1 m; grows with depth squared; > 0.
  int bridge_px = 3;           // Holes up to this wide do not part an object; >= 1.
  double merge_share = 0.2;    // A part with this share of its footprint and of its height within another's belongs to it (shadows
                               // and dark insides part what is one); > 0, above 1 to keep all apart.
  double crease_arm_m = 0.02;  // Where a surface bends inwards, two arms of this length on it say how much; > 0.
  double min_crease_deg = 60.0;    // Surfaces that meet in a crease bent so far (in the mean) are different objects; [20, 180].
  double min_part_m = 0.06;        // ...of at least this size (diagonal; a cap or a handle is part of its bottle or mug); > 0.
  double min_crease_share = 0.25;  // ...and where the crease is at least this long, over the smaller one's size; > 0.
  double min_size_m = 0.02;        // Smaller (longest side) clusters are not objects; > 0.
  double max_size_m = 0.6;         // > min_size_m.
  int min_pixels = 300;            // >= 1.

  void Check() const;
};

struct Cluster {
  cv::Mat mask;              // CV_8UC1, 255 on the object, holes closed; size of the frame.
  cv::Rect box;              // Bounding box of the mask.
  int pixels = 0;            // With depth.
  Eigen::Vector3d centroid;  // Camera coordinates, metres.
  bool touches_border = false;
};

// Objects are parted at jumps in depth and where their surfaces meet in sharp concave creases (one stands on the other, or they
// touch); parts of one object are joined: pieces within each other, inside and outside of a vessel, a handle, and what goes on
// behind a nearer object. A vessel's floor belongs to its mask. Clusters by falling number of pixels. Camera coordinates. Empty
// where the frame has no depth. About 25 ms for 640x480.
std::vector<Cluster> FindClusters(const rgbd::Frame& frame, const Plane& plane, const ClusterParams& params);

// The cluster that holds the pixel (or whose mask is nearest, within 20 px); -1 where there is none.
int ClusterAt(const std::vector<Cluster>& clusters, const Eigen::Vector2d& pixel);

// The cluster whose mask is nearest to the image centre; -1 where there is none.
int ClusterNearestCentre(const std::vector<Cluster>& clusters);

}  // namespace vantage::segmentation
