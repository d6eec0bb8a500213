//! Solves a problem with one worker of the real service on a thread of this process.
#![allow(unreachable_pub, missing_docs, reason = "each test file compiles its own copy")]

use macro_solver::observer::{Observer, Run};
use macro_solver::pool::{Interrupt, JoiningWorkers, Pool, PoolSettings};
use macro_solver::problem::Problem;
use macro_solver::solve::solve;
use protocol::Definition;
use protocol::transport::in_process::channel;
use rve_server::engine::GrainEngine;
use rve_server::server::{ServeOptions, serve};

/// The same definition stands behind every point.
pub fn solved_in_process(problem: &Problem, definition: Definition, observer: &mut dyn Observer) -> Run {
    let (port, connector) = channel();
    let worker =
        std::thread::spawn(move || serve(&mut GrainEngine, &mut connector.join(), &ServeOptions::new("test")));
    let mut settings = PoolSettings::new("test");
    settings.tangents = vec![problem.stages[0].strategy.tangent];
    let points = vec![0; problem.point_count()];
    let mut pool = Pool::new(port, Box::new(JoiningWorkers), Interrupt::new(), settings, vec![definition], &points);
    pool.gather(1).unwrap();
    let run = solve(problem, &mut pool, observer);
    pool.close();
    drop(pool);
    worker.join().unwrap().unwrap();
    run
}
