#include "ros/programs.h"

int main(int argc, char** argv) { return tissue_sim::run_simulator(argc, argv); }
