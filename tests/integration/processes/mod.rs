//! Workers that come, die and come back, and checkpoints: the bytes of a run are the same whatever happens.

mod control;
mod faults;
mod faults_in_cycles;
mod grain_pool;
mod interruptions;
mod pool_in_c;
mod pool_in_process;
mod pool_processes;
mod pool_shared_memory;
mod resume;
mod standing_workers;
