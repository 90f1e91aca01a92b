# Adds the GPU backend to tissue_sim_core where nvcc (CUDA 11.4 or newer) is found; sets
# tissue_sim_has_cuda. The CUDA runtime is linked statically, so no CUDA library is needed to run.
set(tissue_sim_has_cuda FALSE)
include(${CMAKE_CURRENT_LIST_DIR}/cuda_architectures.cmake)
if(NOT CMAKE_CUDA_COMPILER AND DEFINED ENV{CUDACXX})
  set(CMAKE_CUDA_COMPILER $ENV{CUDACXX} CACHE FILEPATH "CUDACXX of the environment")
endif()
if(NOT CMAKE_CUDA_COMPILER)
  find_program(CMAKE_CUDA_COMPILER nvcc PATHS /usr/local/cuda/bin DOC "nvcc")
endif()

# Tried before CMake tries it: CMake ends where it fails (or, asked whether it works, keeps to itself
# what it said), and without a GPU backend all else can be built.
if(CMAKE_CUDA_COMPILER AND NOT DEFINED CMAKE_CUDA_COMPILER_ID)
  set(tissue_sim_trial ${CMAKE_CURRENT_BINARY_DIR}/CMakeFiles/tissue_sim_nvcc)
  file(WRITE ${tissue_sim_trial}.cu "__global__ void kernel() {}\n")
  separate_arguments(tissue_sim_trial_flags UNIX_COMMAND "${CMAKE_CUDA_FLAGS} $ENV{CUDAFLAGS}")
  if(CMAKE_CUDA_HOST_COMPILER)
    list(APPEND tissue_sim_trial_flags -ccbin ${CMAKE_CUDA_HOST_COMPILER})
  elseif(DEFINED ENV{CUDAHOSTCXX})
    list(APPEND tissue_sim_trial_flags -ccbin $ENV{CUDAHOSTCXX})
  endif()
  execute_process(
    COMMAND ${CMAKE_CUDA_COMPILER} ${tissue_sim_trial_flags} -c ${tissue_sim_trial}.cu
            -o ${tissue_sim_trial}.o
    RESULT_VARIABLE tissue_sim_trial_result OUTPUT_VARIABLE tissue_sim_trial_said
    ERROR_VARIABLE tissue_sim_trial_said)
endif()

if(NOT CMAKE_CUDA_COMPILER)
  message(STATUS "tissue_sim: no GPU backend, for nvcc was not found (on the PATH, in "
                 "/usr/local/cuda/bin); if it is elsewhere, set CUDACXX to its path")
elseif(tissue_sim_trial_result)  # a number that is not 0, or why it could not be run
  string(STRIP "${tissue_sim_trial_said}" tissue_sim_trial_said)
  message(WARNING "tissue_sim: no GPU backend, for ${CMAKE_CUDA_COMPILER} fails "
                  "(${tissue_sim_trial_result}) to compile an empty kernel. It said:\n"
                  "${tissue_sim_trial_said}\nMend that (another host compiler: set CUDAHOSTCXX) and "
                  "configure again, or set TISSUE_SIM_CUDA=OFF")
else()
  # Named before CMake tries the compiler, for its own default may be older than it can build for.
  set(tissue_sim_default_architectures FALSE)
  if(NOT DEFINED CMAKE_CUDA_ARCHITECTURES)
    set(tissue_sim_default_architectures TRUE)
    set(CMAKE_CUDA_ARCHITECTURES 75)
  endif()
  enable_language(CUDA)
  if(CMAKE_CUDA_COMPILER_VERSION VERSION_LESS 11.4)
    message(STATUS "tissue_sim: no GPU backend, for CUDA ${CMAKE_CUDA_COMPILER_VERSION} is older "
                   "than 11.4")
  else()
    set(tissue_sim_has_cuda TRUE)
  endif()
endif()

if(tissue_sim_has_cuda)
  if(tissue_sim_default_architectures)
    tissue_sim_architectures(${CMAKE_CUDA_COMPILER_VERSION} CMAKE_CUDA_ARCHITECTURES)
  endif()
  message(STATUS "tissue_sim: GPU backend by CUDA ${CMAKE_CUDA_COMPILER_VERSION} for compute "
                 "capabilities ${CMAKE_CUDA_ARCHITECTURES}")
  # Constants and weights are constexpr functions that both sides use.
  set(tissue_sim_nvcc --expt-relaxed-constexpr)
  if(CMAKE_VERSION VERSION_LESS 3.18)  # which knows neither CUDA's C++17 nor CMAKE_CUDA_ARCHITECTURES
    tissue_sim_gencode("${CMAKE_CUDA_ARCHITECTURES}" tissue_sim_options)
    list(APPEND tissue_sim_nvcc -std=c++17 ${tissue_sim_options})
  else()
    set(CMAKE_CUDA_STANDARD 17)
    set(CMAKE_CUDA_STANDARD_REQUIRED ON)
    # tissue_sim_core was made before these were set.
    set_target_properties(tissue_sim_core PROPERTIES CUDA_STANDARD 17 CUDA_STANDARD_REQUIRED ON)
  endif()
  file(GLOB_RECURSE cuda_sources CONFIGURE_DEPENDS src/*.cu)
  file(GLOB cuda_hosts CONFIGURE_DEPENDS src/*/cuda/*.cpp)
  target_sources(tissue_sim_core PRIVATE ${cuda_sources} ${cuda_hosts})
  set_source_files_properties(${cuda_sources} ${cuda_hosts} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
  # Waiting for divisions and roots of a colour is what a colour takes; two units in the last place
  # off they take a third. Denormals are flushed as on the CPU.
  set_source_files_properties(src/pbd/cuda/launches.cu src/pbd/cuda/one_block.cu PROPERTIES
                              COMPILE_OPTIONS "--ftz=true;--prec-div=false;--prec-sqrt=false")
  set_target_properties(tissue_sim_core PROPERTIES CUDA_ARCHITECTURES "${CMAKE_CUDA_ARCHITECTURES}"
                        CUDA_RUNTIME_LIBRARY Static)
  target_compile_definitions(tissue_sim_core PUBLIC TISSUE_SIM_CUDA)
  target_include_directories(tissue_sim_core SYSTEM PRIVATE
                             ${CMAKE_CUDA_TOOLKIT_INCLUDE_DIRECTORIES})
  target_compile_options(tissue_sim_core PRIVATE $<$<COMPILE_LANGUAGE:CUDA>:${tissue_sim_nvcc}>)
endif()
