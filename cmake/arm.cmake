# arm_node, a CRTK arm without a robot, and play_marker, by which a hand moves the tools in RViz.

file(GLOB arm_node_sources CONFIGURE_DEPENDS src/ros/arm/*.cpp)
add_executable(arm_node ${arm_node_sources})
target_link_libraries(arm_node PRIVATE tissue_sim_node tissue_sim_arm)
target_compile_options(arm_node PRIVATE ${tissue_sim_warnings})
set_target_properties(arm_node PROPERTIES UNITY_BUILD ON)

# crtk_msgs is in no distribution: where it was built from its source, some topics more are there.
add_library(tissue_sim_crtk_msgs INTERFACE)
target_link_libraries(arm_node PRIVATE tissue_sim_crtk_msgs)
find_package(crtk_msgs QUIET)
if(crtk_msgs_FOUND)
  find_file(crtk_msgs_inverse crtk_msgs/QueryInverseKinematics.h PATHS ${crtk_msgs_INCLUDE_DIRS}
            NO_DEFAULT_PATH)
endif()
if(crtk_msgs_FOUND AND (crtk_msgs_inverse OR TARGET crtk_msgs_generate_messages_cpp))
  message(STATUS "tissue_sim: arm_node with crtk_msgs")
  target_compile_definitions(tissue_sim_crtk_msgs INTERFACE TISSUE_SIM_HAS_CRTK_MSGS)
  #catkin_lint: ignore_once external_directory external_interface_path
  target_include_directories(tissue_sim_crtk_msgs SYSTEM INTERFACE ${crtk_msgs_INCLUDE_DIRS})
  if(crtk_msgs_EXPORTED_TARGETS)
    add_dependencies(arm_node ${crtk_msgs_EXPORTED_TARGETS})
  endif()
else()
  message(STATUS "tissue_sim: arm_node without operating_state, state_command and kinematic services: "
                 "crtk_msgs was not found (docs/arm.md)")
endif()

set(play_marker)
find_package(interactive_markers QUIET)
if(interactive_markers_FOUND)
  set(play_marker play_marker)
  add_executable(play_marker src/ros/programs/play_marker.cpp)
  target_link_libraries(play_marker PRIVATE tissue_sim_node ${interactive_markers_LIBRARIES})
  #catkin_lint: ignore_once external_directory external_interface_path
  target_include_directories(play_marker SYSTEM PRIVATE ${interactive_markers_INCLUDE_DIRS})
  target_compile_options(play_marker PRIVATE ${tissue_sim_warnings})
else()
  message(STATUS "tissue_sim: play_marker is left out, interactive_markers was not found")
endif()
foreach(target arm_node ${play_marker})
  set_target_properties(${target} PROPERTIES INSTALL_RPATH "$ORIGIN/..:$ORIGIN" BUILD_RPATH_USE_ORIGIN ON)
endforeach()
