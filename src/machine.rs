//! What was measured on: without it no figure can be compared.

use crate::build_info;
use crate::side_by_side::cores;
use serde::Serialize;
use std::fs;
use std::time::{SystemTime, UNIX_EPOCH};

/// The machine, the program and the moment of a measurement.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Machine {
    /// Day of the measurement, UTC, as `2026-11-21`.
    pub date: String,
    /// Processor as it calls itself.
    pub processor: String,
    /// Its instruction sets that matter to us, of those that the kernel lists.
    pub instructions: Vec<String>,
    /// Cores that this process may use.
    pub cores: usize,
    /// Memory, GB.
    pub memory_gb: f64,
    /// Kernel release.
    pub kernel: String,
    /// Runnable processes on average over the last minute, before the study began: what it shared the cores with.
    pub load: f64,
    /// Version of this program.
    pub grainspan: String,
    /// Compiler that built it.
    pub compiler: String,
    /// Optimisation level and flags that it was built with.
    pub build: String,
}

impl Machine {
    /// This machine, now. What the system does not tell is left empty.
    pub fn here() -> Self {
        let processor = read("/proc/cpuinfo");
        let field = |name: &str| {
            let line = processor.lines().find(|line| line.split(':').next().is_some_and(|key| key.trim() == name));
            line.and_then(|line| line.split_once(':')).map_or("", |(_, value)| value.trim())
        };
        let memory = read("/proc/meminfo");
        let kilobytes = memory.split_whitespace().nth(1).and_then(|number| number.parse::<f64>().ok());
        let flags = build_info::FLAGS;
        let checks = if cfg!(debug_assertions) { " with debug assertions" } else { "" };
        let seconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
        Self {
            date: date(seconds),
            processor: field("model name").to_owned(),
            instructions: field("flags").split_whitespace().filter(|name| matters(name)).map(str::to_owned).collect(),
            cores: cores().get(),
            memory_gb: kilobytes.map_or(f64::NAN, |amount| (amount * 1.024e-6 * 10.0).round() / 10.0),
            kernel: read("/proc/sys/kernel/osrelease").trim().to_owned(),
            load: read("/proc/loadavg").split(' ').next().and_then(|text| text.parse().ok()).unwrap_or(f64::NAN),
            grainspan: build_info::VERSION.to_owned(),
            compiler: build_info::COMPILER.to_owned(),
            build: format!("-O{}{checks} {flags}", build_info::OPTIMISATION).trim().to_owned(),
        }
    }

    /// One line for people.
    pub fn line(&self) -> String {
        format!(
            "{}, {} cores ({:.1} GB), Linux {}, load {:.1} at the start; grainspan {} by {}, {}; {}",
            self.processor,
            self.cores,
            self.memory_gb,
            self.kernel,
            self.load,
            self.grainspan,
            self.compiler,
            self.build,
            self.date
        )
    }
}

fn read(path: &str) -> String {
    fs::read_to_string(path).unwrap_or_default()
}

/// Whether an instruction set changes what our kernels can do.
fn matters(name: &str) -> bool {
    ["sse4_2", "avx", "avx2", "fma", "asimd", "sve"].contains(&name) || name.starts_with("avx512")
}

/// The day on which a second since 1970 falls, in the Gregorian calendar.
fn date(seconds: u64) -> String {
    let mut days = seconds / 86_400;
    let mut year = 1970;
    let leap = |year: u64| (year.is_multiple_of(4) && !year.is_multiple_of(100)) || year.is_multiple_of(400);
    while days >= 365 + u64::from(leap(year)) {
        days -= 365 + u64::from(leap(year));
        year += 1;
    }
    let mut month = 1;
    for length in [31, 28 + u64::from(leap(year)), 31, 30, 31, 30, 31, 31, 30, 31, 30, 31] {
        if days < length {
            break;
        }
        days -= length;
        month += 1;
    }
    format!("{year}-{month:02}-{:02}", days + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_are_named_as_the_calendar_does() {
        let expected = [(0, "1970-01-01"), (951_782_400, "2000-02-29"), (1_798_761_599, "2026-12-31")];
        for (seconds, name) in expected {
            assert_eq!(date(seconds), name);
        }
    }

    #[test]
    fn this_machine_has_cores_and_a_kernel() {
        let here = Machine::here();
        assert!(here.cores > 0 && !here.kernel.is_empty() && here.compiler.starts_with("rustc "), "{here:?}");
    }
}
