//! Three hosts on one machine: network namespaces and the links between them.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::Mutex;

/// Names of the hosts, in the order of their numbers: the hub and its two spokes.
const HOSTS: [&str; 3] = ["m", "a", "b"];

/// Addresses of the hub, as its spokes see it.
pub const HUB: [&str; 2] = ["10.77.1.1", "10.77.2.1"];

/// Addresses of the spokes.
pub const SPOKES: [&str; 2] = ["10.77.1.2", "10.77.2.2"];

/// Why no hosts can be made here, if so.
pub fn missing() -> Option<String> {
    if !rustix::process::geteuid().is_root() {
        return Some("network namespaces need root".to_owned());
    }
    if !Path::new("/dev/net/tun").exists() {
        return Some("there is no /dev/net/tun".to_owned());
    }
    let works = |program: &str, arguments: &[&str]| {
        let mut command = Command::new(program);
        command.args(arguments).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        command.status().is_ok_and(|status| status.success())
    };
    if !works("python3", &["-c", "import ctypes, fcntl"]) {
        return Some("there is no python3".to_owned());
    }
    let probe = format!("gs{}probe", std::process::id());
    if !works("ip", &["netns", "add", &probe]) {
        return Some("`ip netns add` does not work".to_owned());
    }
    let _ = works("ip", &["netns", "del", &probe]);
    None
}

fn make_namespaces(stem: &str) -> Result<(), String> {
    for host in HOSTS {
        let name = format!("{stem}{host}");
        let _ = Command::new("ip").args(["netns", "del", &name]).stderr(Stdio::null()).status();
        ip(&["netns", "add", &name])?;
    }
    Ok(())
}

fn remove_namespaces(stem: &str) {
    for host in HOSTS {
        let name = format!("{stem}{host}");
        let _ = Command::new("ip").args(["netns", "del", &name]).stderr(Stdio::null()).status();
    }
}

fn ip(words: &[&str]) -> Result<(), String> {
    match Command::new("ip").args(words).status() {
        Ok(status) if status.success() => Ok(()),
        _ => Err(format!("`ip {}` failed", words.join(" "))),
    }
}

/// The program in a namespace.
fn program_in(namespace: &str, arguments: &[String]) -> Command {
    let mut command = Command::new("ip");
    command.args(["netns", "exec", namespace]);
    command.arg(env!("CARGO_BIN_EXE_grainspan")).args(arguments);
    command.current_dir(env!("CARGO_MANIFEST_DIR")).env_remove("RUST_LOG");
    command.stdin(Stdio::null()).stdout(Stdio::null());
    command
}

/// The same hosts with the same addresses, joined by the kernel's own pairs of devices: nothing is lost, and no other program carries
/// the packets. For measurements.
pub struct Cable {
    stem: String,
}

impl Cable {
    /// Makes namespaces and devices.
    pub fn make() -> Result<Self, String> {
        let cable = Self { stem: format!("gs{}c", std::process::id()) };
        make_namespaces(&cable.stem)?;
        let hub = format!("{}{}", cable.stem, HOSTS[0]);
        for (spoke, (here, there)) in (1..).zip(HUB.into_iter().zip(SPOKES)) {
            let name = format!("{}{}", cable.stem, HOSTS[spoke]);
            let near = format!("s{spoke}");
            ip(&["-n", &hub, "link", "add", &near, "type", "veth", "peer", "name", "hub", "netns", &name])?;
            for (host, device, address) in [(&hub, near.as_str(), here), (&name, "hub", there)] {
                ip(&["-n", host, "addr", "add", &format!("{address}/24"), "dev", device])?;
                ip(&["-n", host, "link", "set", device, "up"])?;
                ip(&["-n", host, "link", "set", "lo", "up"])?;
            }
        }
        Ok(cable)
    }

    /// The program on a host: 0 is the hub, 1 and 2 its spokes.
    pub fn program(&self, host: usize, arguments: &[String]) -> Command {
        program_in(&format!("{}{}", self.stem, HOSTS[host]), arguments)
    }
}

impl Drop for Cable {
    fn drop(&mut self) {
        remove_namespaces(&self.stem);
    }
}

/// Namespaces and links of one case; removed in the end.
pub struct Network {
    stem: String,
    link: Child,
    orders: Mutex<ChildStdin>,
}

impl Network {
    /// Makes them. `lane` tells those of cases apart that run at the same time.
    pub fn make(lane: u64, seed: u64) -> Result<Self, String> {
        let stem = format!("gs{}x{lane}", std::process::id());
        make_namespaces(&stem)?;
        let mut link = Command::new("python3")
            .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/hosts/link.py"))
            .args(HOSTS.map(|host| format!("{stem}{host}")))
            .env("LINK_SEED", (seed >> 1).to_string())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|error| format!("the links could not be started: {error}"))?;
        let mut line = String::new();
        let output = link.stdout.take().ok_or("the links say nothing")?;
        let ready = BufReader::new(output).read_line(&mut line).is_ok() && line.trim() == "ready";
        let orders = Mutex::new(link.stdin.take().ok_or("the links hear nothing")?);
        let network = Self { stem, link, orders };
        if ready { Ok(network) } else { Err("the links could not be made".to_owned()) }
    }

    /// Name of a host's namespace.
    pub fn name(&self, host: usize) -> String {
        format!("{}{}", self.stem, HOSTS[host])
    }

    /// The program on a host: 0 is the hub, 1 and 2 its spokes.
    pub fn program(&self, host: usize, arguments: &[String]) -> Command {
        program_in(&self.name(host), arguments)
    }

    /// Sets the share of packets that spoke 1 or 2 loses, and the mean delay of the others, s.
    pub fn disturb(&self, spoke: usize, loss: f64, delay: f64) {
        let mut orders = self.orders.lock().expect("nobody panics with the orders in hand");
        let _ = writeln!(orders, "{spoke} {loss} {delay}").and_then(|()| orders.flush());
    }
}

impl Drop for Network {
    fn drop(&mut self) {
        let _ = self.link.kill();
        let _ = self.link.wait();
        remove_namespaces(&self.stem);
    }
}
