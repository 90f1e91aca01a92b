// The programs of the package, each main() of which is one line: what is compiled with the rest of
// src/ros reads ROS' headers once.
#pragma once

namespace tissue_sim {

/// Each returns what the program ends with.
int run_simulator(int argc, char** argv);
int play_instrument(int argc, char** argv);
int replay(int argc, char** argv);

}  // namespace tissue_sim
