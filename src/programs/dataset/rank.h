// Which part of the work is whose, where an MPI launcher started several processes.
#pragma once

namespace tissue_sim {

/// What the launcher says in the environment (Open MPI, MPICH and those that follow its PMI,
/// Slurm). It takes no MPI library, for the processes have nothing to tell each other.
struct Rank {
  int number = 0, of = 1, on_machine = 1;
};

/// Rank 0 of 1 without a launcher. Throws std::invalid_argument for what cannot be.
Rank launched_rank();

/// How many of `items` are the rank's: every rank.of-th.
int count_of(const Rank& rank, int items);
/// The i-th of them.
int item_of(const Rank& rank, int i);

}  // namespace tissue_sim
