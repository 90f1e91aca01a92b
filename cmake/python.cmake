# The Python module tissue_sim: python_folder, where it can be imported from, and the target
# tissue_sim_python, where pybind11 is found. Built by `pip install .` too, which asks for it alone.
option(TISSUE_SIM_PYTHON "Fail where pybind11 is not found, in place of leaving the Python module out" OFF)
if(NOT SKBUILD)  # pip brings its own; else with the headers of the Python that ROS is installed for,
                 # without which pybind11 ends in an error
  if(PYTHON_EXECUTABLE AND NOT Python3_EXECUTABLE)
    set(Python3_EXECUTABLE ${PYTHON_EXECUTABLE})
  endif()
  find_package(Python3 QUIET COMPONENTS Interpreter Development)
endif()
if(SKBUILD OR Python3_Development_FOUND)
  find_package(pybind11 QUIET)
endif()
if(pybind11_FOUND)
  pybind11_add_module(tissue_sim_python NO_EXTRAS python/module.cpp python/convert.cpp python/reports.cpp
                      python/gpu_array.cpp)
  target_compile_options(tissue_sim_python PRIVATE ${tissue_sim_warnings})
  target_link_libraries(tissue_sim_python PRIVATE tissue_sim_core yaml-cpp)
  if(build_ros)  # beside the messages, whose package of the same name genmsg made
    set(python_destination ${CATKIN_PACKAGE_PYTHON_DESTINATION})
    set(python_part)
    set(python_folder ${CATKIN_DEVEL_PREFIX}/${python_destination})
  else()
    set(python_destination tissue_sim)  # of a wheel: an installed core does not have it
    set(python_part EXCLUDE_FROM_ALL)
    set(python_folder ${CMAKE_CURRENT_BINARY_DIR}/python/tissue_sim)
  endif()
  set_target_properties(tissue_sim_python PROPERTIES OUTPUT_NAME _core LIBRARY_OUTPUT_DIRECTORY ${python_folder}
                        INSTALL_RPATH "$ORIGIN/../../..")
  file(GLOB python_files CONFIGURE_DEPENDS python/tissue_sim/*.py python/tissue_sim/*.pyi python/tissue_sim/py.typed)
  foreach(file ${python_files})
    get_filename_component(name ${file} NAME)
    configure_file(${file} ${python_folder}/${name} COPYONLY)
  endforeach()
  #catkin_lint: ignore_once undefined_target
  install(TARGETS tissue_sim_python LIBRARY DESTINATION ${python_destination} COMPONENT python ${python_part})
  install(FILES ${python_files} DESTINATION ${python_destination} COMPONENT python ${python_part})
elseif(TISSUE_SIM_PYTHON)
  message(FATAL_ERROR "tissue_sim: pybind11 was not found: install pybind11-dev and python3-dev")
else()
  message(STATUS "tissue_sim: pybind11 was not found: no Python module (pybind11-dev, python3-dev)")
endif()
