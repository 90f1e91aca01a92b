# PCL, which users' perception is written with: tissue_sim_has_pcl, and the target tissue_sim_pcl with
# its common, search and segmentation. Directly, for its CMake package finds VTK, Qt and all.
option(TISSUE_SIM_REQUIRE_PCL "Fail where PCL is not found, in place of leaving out what needs it" OFF)
file(GLOB pcl_include_dirs /usr/include/pcl-1.* /usr/local/include/pcl-1.*)
find_path(PCL_CLUSTERS_INCLUDE_DIR pcl/segmentation/extract_clusters.h HINTS ${pcl_include_dirs})
find_path(PCL_CONVERSIONS_INCLUDE_DIR pcl_conversions/pcl_conversions.h HINTS ${catkin_INCLUDE_DIRS})
set(pcl_libraries)
foreach(component segmentation sample_consensus search kdtree octree common)
  find_library(PCL_${component}_LIBRARY pcl_${component})
  list(APPEND pcl_libraries ${PCL_${component}_LIBRARY})
endforeach()
find_library(LZ4_LIBRARY lz4)  # of FLANN's headers, where a distribution took it out of them
if(LZ4_LIBRARY)
  list(APPEND pcl_libraries ${LZ4_LIBRARY})
endif()
set(tissue_sim_has_pcl FALSE)
if(PCL_CLUSTERS_INCLUDE_DIR AND NOT "${pcl_libraries}" MATCHES "NOTFOUND"
   AND (PCL_CONVERSIONS_INCLUDE_DIR OR NOT build_ros))
  set(tissue_sim_has_pcl TRUE)
  add_library(tissue_sim_pcl INTERFACE)
  # Of the programs of this package alone: nothing that is exported links it.
  #catkin_lint: ignore_once external_interface_path
  target_include_directories(tissue_sim_pcl SYSTEM INTERFACE ${PCL_CLUSTERS_INCLUDE_DIR})
  if(PCL_CONVERSIONS_INCLUDE_DIR)
    #catkin_lint: ignore_once external_interface_path
    target_include_directories(tissue_sim_pcl SYSTEM INTERFACE ${PCL_CONVERSIONS_INCLUDE_DIR})
  endif()
  target_link_libraries(tissue_sim_pcl INTERFACE ${pcl_libraries})
elseif(TISSUE_SIM_REQUIRE_PCL)
  message(FATAL_ERROR "tissue_sim: PCL was not found: install libpcl-dev, with ROS ros-noetic-pcl-conversions "
                      "(Debian: libpcl-conversions-dev)")
else()
  message(STATUS "tissue_sim: PCL was not found: no cluster_fragments, and cuts are not compared with its clusters")
endif()
