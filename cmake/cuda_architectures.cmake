# What nvcc is asked for, by the names of CMAKE_CUDA_ARCHITECTURES: 86 (code and PTX), 86-real (code),
# 86-virtual (PTX). PTX of the newest lets the driver of a newer GPU make its own code.

# Sets `result` to architectures that end in the newest of those given with its PTX, the others
# without: the list for this CUDA, oldest first.
function(tissue_sim_architectures cuda_version result)
  set(all 75 80 86)
  if(NOT cuda_version VERSION_LESS 11.8)
    list(APPEND all 90)
  endif()
  set(list)
  foreach(architecture ${all})
    list(APPEND list ${architecture}-real)
  endforeach()
  string(REGEX REPLACE "-real$" "" list "${list}")
  set(${result} ${list} PARENT_SCOPE)
endfunction()

# Sets `result` to nvcc's options for these architectures, for CMake before 3.18, which knows no
# CMAKE_CUDA_ARCHITECTURES.
function(tissue_sim_gencode architectures result)
  set(options)
  foreach(architecture ${architectures})
    if(NOT architecture MATCHES "^([0-9]+[af]?)(-real|-virtual)?$")
      message(FATAL_ERROR "CMAKE_CUDA_ARCHITECTURES is ${architectures}: \"${architecture}\" is none "
                          "that CMake ${CMAKE_VERSION} can ask for; give numbers, 86 for instance")
    endif()
    set(number ${CMAKE_MATCH_1})
    if(NOT CMAKE_MATCH_2 STREQUAL "-virtual")
      list(APPEND options "SHELL:-gencode arch=compute_${number},code=sm_${number}")
    endif()
    if(NOT CMAKE_MATCH_2 STREQUAL "-real")
      list(APPEND options "SHELL:-gencode arch=compute_${number},code=compute_${number}")
    endif()
  endforeach()
  set(${result} ${options} PARENT_SCOPE)
endfunction()
