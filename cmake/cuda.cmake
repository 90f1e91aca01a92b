# Adds the GPU backend to tissue_sim_core where nvcc (CUDA 11.4 or newer) is found; sets
# tissue_sim_has_cuda. The CUDA runtime is linked statically, so no CUDA library is needed to run.
set(tissue_sim_has_cuda FALSE)
include(CheckLanguage)
if(NOT CMAKE_CUDA_COMPILER AND NOT DEFINED ENV{CUDACXX} AND EXISTS /usr/local/cuda/bin/nvcc)
  set(CMAKE_CUDA_COMPILER /usr/local/cuda/bin/nvcc CACHE FILEPATH "nvcc, not on the PATH")
endif()
# Named before the compiler is tried, for its own default may be older than it can build for.
set(tissue_sim_default_architectures FALSE)
if(NOT DEFINED CMAKE_CUDA_ARCHITECTURES)
  set(tissue_sim_default_architectures TRUE)
  set(CMAKE_CUDA_ARCHITECTURES 75)
endif()
check_language(CUDA)
if(CMAKE_CUDA_COMPILER)
  enable_language(CUDA)
  if(CMAKE_CUDA_COMPILER_VERSION VERSION_LESS 11.4)
    message(STATUS "tissue_sim: no GPU backend, for CUDA ${CMAKE_CUDA_COMPILER_VERSION} is older "
                   "than 11.4")
  else()
    set(tissue_sim_has_cuda TRUE)
  endif()
else()
  message(STATUS "tissue_sim: no GPU backend, for nvcc was not found")
endif()

if(tissue_sim_has_cuda)
  if(tissue_sim_default_architectures)
    set(CMAKE_CUDA_ARCHITECTURES 75 80 86)
    if(NOT CMAKE_CUDA_COMPILER_VERSION VERSION_LESS 11.8)
      list(APPEND CMAKE_CUDA_ARCHITECTURES 90)
    endif()
  endif()
  message(STATUS "tissue_sim: GPU backend by CUDA ${CMAKE_CUDA_COMPILER_VERSION} for compute "
                 "capabilities ${CMAKE_CUDA_ARCHITECTURES}")
  # Constants and weights are constexpr functions that both sides use.
  set(tissue_sim_nvcc --expt-relaxed-constexpr)
  if(CMAKE_VERSION VERSION_LESS 3.18)  # which knows neither CUDA's C++17 nor CMAKE_CUDA_ARCHITECTURES
    list(APPEND tissue_sim_nvcc -std=c++17)
    foreach(architecture ${CMAKE_CUDA_ARCHITECTURES})
      list(APPEND tissue_sim_nvcc
           "SHELL:-gencode arch=compute_${architecture},code=sm_${architecture}")
    endforeach()
  else()
    set(CMAKE_CUDA_STANDARD 17)
    set(CMAKE_CUDA_STANDARD_REQUIRED ON)
    # tissue_sim_core was made before these were set.
    set_target_properties(tissue_sim_core PROPERTIES CUDA_STANDARD 17 CUDA_STANDARD_REQUIRED ON)
  endif()
  file(GLOB_RECURSE cuda_sources CONFIGURE_DEPENDS src/*.cu)
  file(GLOB cuda_hosts CONFIGURE_DEPENDS src/*/cuda/*.cpp)
  target_sources(tissue_sim_core PRIVATE ${cuda_sources} ${cuda_hosts})
  set_target_properties(tissue_sim_core PROPERTIES CUDA_ARCHITECTURES "${CMAKE_CUDA_ARCHITECTURES}"
                        CUDA_RUNTIME_LIBRARY Static)
  target_compile_definitions(tissue_sim_core PUBLIC TISSUE_SIM_CUDA)
  target_include_directories(tissue_sim_core SYSTEM PRIVATE
                             ${CMAKE_CUDA_TOOLKIT_INCLUDE_DIRECTORIES})
  target_compile_options(tissue_sim_core PRIVATE $<$<COMPILE_LANGUAGE:CUDA>:${tissue_sim_nvcc}>)
endif()
