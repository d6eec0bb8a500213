//! Files under `deploy/` name things that exist: commands, options, files, services.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(name: &str) -> String {
    fs::read_to_string(root().join("deploy").join(name)).unwrap()
}

/// Whether a command of the program takes all these options.
fn takes(command: &str, options: &[&str]) {
    let help = Command::new(env!("CARGO_BIN_EXE_grainspan")).args([command, "--help"]).output().unwrap();
    let help = String::from_utf8(help.stdout).unwrap();
    for option in options {
        assert!(help.contains(option), "`grainspan {command}` does not take {option}");
    }
}

#[test]
fn commands_in_the_files_are_commands_of_the_program() {
    assert!(read("systemd/grainspan-worker@.service").contains("rve-server --run ${GRAINSPAN_POOL} --standing"));
    assert!(read("container/compose.yaml").contains("\"rve-server\", \"--run\", \"pool\", \"--standing\""));
    takes("rve-server", &["--run", "--standing"]);
    assert!(read("slurm/grainspan.sbatch").contains("run \"$@\" --workers \"$workers\" --quiet"));
    takes("run", &["--workers", "--quiet", "--attach", "--out", "--listen", "--secret"]);
    assert!(read("systemd/grainspan-agent.service").contains("agent --join ${GRAINSPAN_JOIN} --secret"));
    assert!(read("container/compose-hosts.yaml").contains("\"agent\", \"--join\", \"macro:7400\", \"--secret\""));
    assert!(read("slurm/grainspan-hosts.sbatch").contains("agent --join \"$out/join\" --workers \"$cores\""));
    takes("agent", &["--join", "--secret", "--workers", "--timeout", "--standing"]);
}

/// From Slurm 22.05 on `srun` does not take the number of cores of its job: without the option an agent would have one core.
#[test]
fn every_srun_says_how_many_cores_a_task_has() {
    let guide = fs::read_to_string(root().join("docs/guide/cluster.md")).unwrap();
    let mut found = 0;
    for text in [read("slurm/grainspan.sbatch"), read("slurm/grainspan-hosts.sbatch"), guide] {
        // In sentences its name stands in a code span.
        for (_, call) in text.lines().filter_map(|line| line.split_once("srun ")) {
            assert!(call.starts_with("--cpus-per-task="), "srun {call}");
            found += 1;
        }
    }
    assert_eq!(found, 4);
}

#[test]
fn the_image_copies_what_there_is() {
    let text = read("container/Containerfile");
    let mut copied = 0;
    for line in text.lines().filter_map(|line| line.strip_prefix("COPY --from=build /source/")) {
        let source = PathBuf::from(line.split(' ').next().unwrap());
        assert!(source.starts_with("target") || root().join(&source).exists(), "{}", source.display());
        copied += 1;
    }
    assert_eq!(copied, 3);
}

/// The compose files as Docker reads them, where its plugin is installed.
#[test]
fn docker_reads_the_compose_files() {
    let compose = |arguments: &[&str]| {
        let output = Command::new("docker").arg("compose").args(arguments).current_dir(root()).output().ok()?;
        Some((output.status.success(), String::from_utf8_lossy(&output.stderr).into_owned()))
    };
    if !compose(&["version"]).is_some_and(|(runs, _)| runs) {
        eprintln!("SKIPPED: `docker compose` is not installed");
        return;
    }
    for file in ["deploy/container/compose.yaml", "deploy/container/compose-hosts.yaml"] {
        let (sound, said) = compose(&["-f", file, "config", "--quiet"]).unwrap();
        assert!(sound, "{file}: {said}");
    }
}

/// The system's own checkers where they are installed; a machine without them has the tests above.
#[test]
fn the_systems_checkers_have_no_complaints() {
    let run = |program: &str, arguments: &[&str]| {
        let output = Command::new(program).args(arguments).current_dir(root().join("deploy")).output().ok()?;
        Some((output.status.success(), String::from_utf8_lossy(&output.stderr).into_owned()))
    };
    for script in ["slurm/grainspan.sbatch", "slurm/grainspan-hosts.sbatch"] {
        let (sound, said) = run("bash", &["-n", script]).expect("there is a shell");
        assert!(sound, "{said}");
        match run("shellcheck", &[script]) {
            Some((sound, said)) => assert!(sound, "{said}"),
            None => eprintln!("SKIPPED: shellcheck is not installed"),
        }
    }
    let units = [
        "verify",
        "--man=no",
        "systemd/grainspan-pool.target",
        "systemd/grainspan-worker@1.service",
        "systemd/grainspan-agent.service",
    ];
    if let Some((_, said)) = run("systemd-analyze", &units) {
        // The program is not installed here, and the file is found by its path.
        let complaints: Vec<_> =
            said.lines().filter(|line| line.contains("grainspan") && !line.contains("is not executable")).collect();
        assert!(complaints.is_empty(), "{complaints:?}");
    }
}
