#include "programs/dataset/rank.h"

#include <cstdlib>
#include <initializer_list>
#include <stdexcept>
#include <string>

namespace tissue_sim {
namespace {

int from_environment(std::initializer_list<const char*> names, int otherwise) {
  for (const char* name : names) {
    if (const char* value = std::getenv(name)) return std::atoi(value);
  }
  return otherwise;
}

}  // namespace

Rank launched_rank() {
  Rank r;
  r.number = from_environment({"OMPI_COMM_WORLD_RANK", "PMI_RANK", "SLURM_PROCID"}, 0);
  r.of = from_environment({"OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_NTASKS"}, 1);
  r.on_machine = from_environment(
      {"OMPI_COMM_WORLD_LOCAL_SIZE", "MPI_LOCALNRANKS", "SLURM_NTASKS_PER_NODE"}, 1);
  if (r.number < 0 || r.number >= r.of || r.on_machine < 1) {
    throw std::invalid_argument("the MPI launcher says rank " + std::to_string(r.number) + " of " +
                                std::to_string(r.of) + " (ranks count from 0 to one less): " +
                                "start it anew, or unset its variables in the environment");
  }
  return r;
}

int count_of(const Rank& rank, int items) {
  return rank.number < items ? (items - rank.number + rank.of - 1) / rank.of : 0;
}

int item_of(const Rank& rank, int i) { return i * rank.of + rank.number; }

}  // namespace tissue_sim
