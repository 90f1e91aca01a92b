# Shared by scripts/run and scripts/test: clears the way for ROS, installs what is missing, builds.
# Sourced, not run. TISSUE_SIM_BUILD names another build folder, TISSUE_SIM_NO_INSTALL=1 leaves apt
# alone (for machines whose packages come from elsewhere).

set -euo pipefail
repo=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)
build=${TISSUE_SIM_BUILD:-$repo/build}
noetic=/opt/ros/noetic/setup.bash

core_packages=(g++ make cmake libeigen3-dev libtbb-dev libyaml-cpp-dev libnanoflann-dev zlib1g-dev
  libembree-dev libgtest-dev libbenchmark-dev python3 python3-dev pybind11-dev)
picture_packages=(python3-numpy python3-matplotlib python3-yaml)
debian_packages=(catkin ros-message-generation ros-message-runtime libroscpp-dev libroslib-dev
  librosbag-storage-dev librostest-dev libtf2-dev libtf2-ros-dev libtf2-geometry-msgs-dev
  libnodelet-dev libnodeletlib-dev libnodeletlib-tools pluginlib-dev libdiagnostic-updater-dev
  libinteractive-markers-dev libimage-transport-dev ros-diagnostic-msgs ros-geometry-msgs ros-sensor-msgs ros-std-msgs ros-std-srvs
  ros-visualization-msgs libdiagnostic-msgs-dev libstd-msgs-dev libstd-srvs-dev libgeometry-msgs-dev
  libsensor-msgs-dev libvisualization-msgs-dev rosout python3-roslaunch python3-rosbag
  python3-rostopic python3-rosservice python3-rosnode python3-rosparam python3-rostest python3-rospy
  python3-tf2-ros python3-std-msgs python3-std-srvs python3-geometry-msgs python3-sensor-msgs
  python3-visualization-msgs python3-diagnostic-msgs rosbash)
noetic_packages=(ros-noetic-{catkin,message-generation,message-runtime,roscpp,roslib,rospy,rostest}
  ros-noetic-{rosbag,rosbag-storage,roslaunch,rosout,rostopic,rosservice,rosnode,rosparam,tf2}
  ros-noetic-{tf2-ros,tf2-geometry-msgs,interactive-markers,image-transport,nodelet,pluginlib,diagnostic-updater,diagnostic-msgs}
  ros-noetic-{std-msgs,std-srvs,geometry-msgs,sensor-msgs,visualization-msgs,rosbash})

# For tests and those who write perception, not for a simulator alone: PCL's packages bring VTK and Qt,
# 380 packages of 200 MB and three minutes.
pcl_packages=(libpcl-dev libpcl-conversions-dev)
if [[ -e $noetic ]]; then pcl_packages=(libpcl-dev ros-noetic-pcl-conversions); fi

# For scripts/lint.
lint_packages=(clang-format clang-tidy catkin-lint doxygen)

# For tests of the Python module; without some of them part of the tests is left out, which says so.
python_packages=(python3-numpy python3-pytest python3-venv python3-pip python3-scipy python3-matplotlib)

say() { printf '\n== %s\n' "$*"; }
fail() { printf '\nerror: %s\n' "$*" >&2; exit 1; }

# Conda and pyenv put their Python, their libraries and their CMake files in front of the system's,
# which ROS is built against. ROS workspaces that the caller has sourced stay.
clear_environment() {
  local entry cuda kept=
  cuda=$(command -v nvcc || true)
  IFS=: read -ra entries <<<"${CMAKE_PREFIX_PATH:-}"
  for entry in "${entries[@]:-}"; do
    if [[ -n $entry && -e $entry/.catkin ]]; then kept+=${kept:+:}$entry; fi
  done
  unset PYTHONPATH PYTHONHOME CONDA_PREFIX VIRTUAL_ENV CMAKE_PREFIX_PATH CC CXX CPPFLAGS CFLAGS \
    CXXFLAGS LDFLAGS
  if [[ -n $kept ]]; then export CMAKE_PREFIX_PATH=$kept; fi
  export PATH=/usr/bin:/bin:/usr/sbin:/sbin:/usr/local/bin${cuda:+:$(dirname "$cuda")}
}

missing_of() {
  local installed
  installed=$(dpkg-query -W -f='${db:Status-Status} ${Package}\n' "$@" 2>/dev/null || true)
  for package in "$@"; do grep -qx "installed $package" <<<"$installed" || echo "$package"; done
}

as_root() {
  if [[ $(id -u) == 0 ]]; then
    env DEBIAN_FRONTEND=noninteractive "$@"
  else
    command -v sudo >/dev/null || fail "sudo is not here, and only root may install: as root, run $*"
    sudo env DEBIAN_FRONTEND=noninteractive "$@"
  fi
}

# install core|ros|lint [more ROS packages, without Noetic's prefix]: asks apt for what is missing, if
# anything is.
install() {
  local kind=$1 wanted missing
  shift
  if [[ -n ${TISSUE_SIM_NO_INSTALL:-} ]]; then return; fi
  command -v dpkg-query >/dev/null && command -v apt-get >/dev/null ||
    fail "this is no Debian or Ubuntu: install ROS 1 and ${core_packages[*]} your own way," \
      "then set TISSUE_SIM_NO_INSTALL=1"
  wanted=("${core_packages[@]}")
  if [[ $kind == ros && -e $noetic ]]; then
    wanted+=("${noetic_packages[@]}" "${picture_packages[@]}" "${@/#/ros-noetic-}")
  elif [[ $kind == ros ]]; then
    wanted+=("${debian_packages[@]}" "${picture_packages[@]}" "$@")
  elif [[ $kind == lint ]]; then
    wanted+=("${lint_packages[@]}")
  fi
  mapfile -t missing < <(missing_of "${wanted[@]}")
  if [[ ${#missing[@]} == 0 ]]; then return; fi
  say "Asking apt for what is missing (log: $build/apt.log)"
  as_root apt-get update >"$build/apt.log" 2>&1 || fail "apt-get update: see $build/apt.log"
  if [[ $kind == ros && ! -e $noetic ]]; then
    if apt-cache show ros-noetic-roscpp >/dev/null 2>&1; then
      mapfile -t missing < <(missing_of "${core_packages[@]}" "${noetic_packages[@]}" \
        "${picture_packages[@]}" "${@/#/ros-noetic-}")
    elif ! apt-cache show libdiagnostic-updater-dev >/dev/null 2>&1; then
      fail "apt knows no ROS 1 here. On Debian 12 it is in main; on Ubuntu 20.04 add its source:" \
        "https://wiki.ros.org/noetic/Installation/Ubuntu (steps 1.2 and 1.3). Then run this again"
    fi
  fi
  printf '   %s\n' "$(fmt -w 96 <<<"${missing[*]}" | sed '2,$s/^/   /')"
  as_root apt-get install -y --no-install-recommends "${missing[@]}" >>"$build/apt.log" 2>&1 || {
    tail -5 "$build/apt.log" >&2
    fail "apt could not install them: see $build/apt.log"
  }
}

# install_if_known PACKAGE...: those of them that apt knows. Without them something is left out, which
# says so itself.
install_if_known() {
  local missing known=()
  if [[ -n ${TISSUE_SIM_NO_INSTALL:-} ]] || ! command -v apt-get >/dev/null; then return; fi
  mapfile -t missing < <(missing_of "$@")
  for package in "${missing[@]}"; do
    if apt-cache show "$package" >/dev/null 2>&1; then known+=("$package"); fi
  done
  if [[ ${#known[@]} == 0 ]]; then return; fi
  say "Asking apt for ${known[*]}"
  as_root apt-get install -y --no-install-recommends "${known[@]}" >>"$build/apt.log" 2>&1 ||
    say "apt could not install them: see $build/apt.log"
}

# Only the percentages of make, on one line where there is a terminal.
show_progress() {
  if [[ -t 1 ]]; then
    awk '/^\[ *[0-9]+%\]/ { printf "\r\033[K   %.90s", $0; fflush() } END { print "" }'
  else
    awk '/^\[ *[0-9]+%\]/ { p = int(substr($0, 2, 3) / 10); if (p != last) print "  ", substr($0, 1, 90)
                            last = p; fflush() }'
  fi
}

# is_configured FOLDER: whether CMake was there already, for this checkout.
is_configured() {
  grep -qxF "CMAKE_HOME_DIRECTORY:INTERNAL=$repo" "$1/CMakeCache.txt" 2>/dev/null
}

# configure FOLDER [cmake options]: a Release build of the package.
configure() {
  local folder=$1
  shift
  if [[ -e $folder/CMakeCache.txt ]] && ! is_configured "$folder"; then
    rm -rf -- "$folder"  # made when the checkout was somewhere else: CMake would refuse it
  fi
  mkdir -p "$folder"
  say "Building in $folder (log: build.log there)"
  cmake -S "$repo" -B "$folder" -DCMAKE_BUILD_TYPE=Release -DPYTHON_EXECUTABLE=/usr/bin/python3 \
    -DTISSUE_SIM_WERROR="${TISSUE_SIM_WERROR:-OFF}" \
    -DTISSUE_SIM_REQUIRE_PCL="${TISSUE_SIM_REQUIRE_PCL:-OFF}" \
    -DTISSUE_SIM_PYTHON="${TISSUE_SIM_PYTHON:-OFF}" "$@" >"$folder/build.log" 2>&1 || {
    grep -A 12 'CMake Error' "$folder/build.log" >&2 || tail -20 "$folder/build.log" >&2
    fail "CMake could not configure: see $folder/build.log"
  }
  sed -n '/tissue_sim: no GPU backend/,/^$/p' "$folder/build.log" | sed 's/^-- //; s/^ */   /'
}

# The GPUs of this machine by compute capability, as CMake names them: "86;90". "unknown" where the
# driver does not tell; nothing where there is none that the GPU backend runs on.
gpus_here() {
  local smi capability
  smi=$(PATH=$PATH:/usr/lib/wsl/lib command -v nvidia-smi) || return 0
  "$smi" -L 2>/dev/null | grep -q '^GPU' || return 0
  capability=$("$smi" --query-gpu=compute_cap --format=csv,noheader 2>/dev/null) || capability=unknown
  if [[ $capability == unknown || $capability == *[!0-9.$'\n']* ]]; then echo unknown; return; fi
  tr -d '. ' <<<"$capability" | awk '$1 >= 75' | sort -nu | paste -sd ';'
}

# choose_gpu FOLDER: sets gpu_options for a build that is to run here: CUDA takes half of the time to
# compile, for nothing where there is no GPU. What an earlier build in the folder has stays in it.
choose_gpu() {
  local gpus
  gpu_options=()
  if is_configured "$1"; then return; fi
  gpus=$(gpus_here)
  case $gpus in
    '')
      gpu_options=(-DTISSUE_SIM_CUDA=OFF)
      say "No NVIDIA GPU here: building for the CPU alone (with --cuda the GPU backend as well)"
      ;;
    unknown) gpu_options=(-DTISSUE_SIM_CUDA=ON) ;;
    *) gpu_options=(-DTISSUE_SIM_CUDA=ON "-DCMAKE_CUDA_ARCHITECTURES=$gpus") ;;
  esac
}

# compile FOLDER [cmake --build options]
compile() {
  local folder=$1 jobs memory
  shift
  memory=$(awk '/MemAvailable/ { print int($2 / 1500000) }' /proc/meminfo)  # 1.5 GB a compiler
  jobs=$(nproc)
  if ((memory < jobs)); then jobs=$((memory > 1 ? memory : 1)); fi
  cmake --build "$folder" -j "$jobs" "$@" 2>&1 | tee -a "$folder/build.log" | show_progress || {
    grep -E -A 3 'error:|undefined reference' "$folder/build.log" | head -24 >&2
    fail "the build failed: see $folder/build.log"
  }
}

# source_setup FILE: catkin's setup files read variables that are not set, and look at $1.
source_setup() {
  local file=$1
  set --
  set +eu
  # shellcheck disable=SC1090
  source "$file"
  set -eu
}

prepare_folder() {
  mkdir -p "$build" 2>/dev/null && [[ -w $build ]] ||
    fail "$build cannot be written: set TISSUE_SIM_BUILD to a folder that can"
  build=$(cd -- "$build" && pwd)
}

# build_ros_package ON|OFF [cmake options]: builds node, core and, with ON, the tests; leaves the
# environment of the devel space.
build_ros_package() {
  local tests=$1 devel=$build/ros/devel
  shift
  # rosrun, and what it completes, passes over a package's own build folder.
  if [[ $build == "$repo/build" ]]; then
    devel=$repo/devel
    rm -rf -- "$build/ros/devel"
  fi
  if [[ -z ${CMAKE_PREFIX_PATH:-} && -e $noetic ]]; then source_setup "$noetic"; fi
  configure "$build/ros" -DTISSUE_SIM_TESTS="$tests" -DCATKIN_ENABLE_TESTING="$tests" \
    -DCATKIN_DEVEL_PREFIX="$devel" "$@"
  ! grep 'tissue_sim: the core only' "$build/ros/build.log" >&2 ||
    fail "CMake does not find all of ROS: see $build/ros/build.log"
  compile "$build/ros"
  source_setup "$devel/setup.bash"
  export PATH=/usr/bin:$PATH
}

# A master of our own, that no other one on this machine is mixed up with.
use_own_master() {
  local port
  port=$(/usr/bin/python3 -c 'import socket
s = socket.socket(); s.bind(("localhost", 0)); print(s.getsockname()[1])')
  unset ROS_IP
  export ROS_HOSTNAME=localhost ROS_MASTER_URI=http://localhost:$port ROS_LOG_DIR=$build/log
  mkdir -p "$ROS_LOG_DIR"
}

# use_environment: a Python environment in the build folder that sees the system's packages and has what
# PyPI alone has in versions that go with them; sets python. Fails where PyPI is not reached.
use_environment() {
  python=$build/venv/bin/python
  if [[ -e $build/venv/complete ]]; then return; fi
  say "Making a Python environment in $build/venv (log: $build/venv.log)"
  { /usr/bin/python3 -m venv --clear --system-site-packages "$build/venv" &&
    "$python" -m pip install --disable-pip-version-check 'distributed' 'gymnasium' 'pyarrow<18' 'numpy<2' pytest \
      scipy matplotlib; } >"$build/venv.log" 2>&1 || return 1
  touch "$build/venv/complete"
}

# run_module MODULE ARGUMENTS...: in the environment that is active if it has the package, else with the
# module that a build of the package left.
run_module() {
  local module=$1 needed='import tissue_sim._core, distributed, matplotlib, pyarrow, scipy' folder
  shift
  if python3 -c "$needed" 2>/dev/null; then exec python3 -m "$module" "$@"; fi
  clear_environment
  prepare_folder
  for folder in "$repo"/devel/lib/python3/dist-packages "$build"/{ros/devel/lib/python3/dist-packages,core/python}; do
    compgen -G "$folder/tissue_sim/_core*.so" >/dev/null || continue
    use_environment || fail "Python's packages could not be had: see $build/venv.log"
    PYTHONPATH=$folder exec "$python" -m "$module" "$@"
  done
  fail "the Python module is not built: pip install '.[sweep]', or install pybind11-dev and run scripts/run"
}
