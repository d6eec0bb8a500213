//! Which processes a process has started.

use std::fs;

/// Living processes whose parent is `pid`, by whatever thread it started them.
pub fn children_of(pid: u32) -> Vec<u32> {
    let mut children = Vec::new();
    for entry in fs::read_dir("/proc").into_iter().flatten().flatten() {
        let Some(candidate) = entry.file_name().to_str().and_then(|name| name.parse::<u32>().ok()) else { continue };
        let Ok(text) = fs::read_to_string(format!("/proc/{candidate}/stat")) else { continue };
        let Some((_, fields)) = text.rsplit_once(')') else { continue };
        let fields: Vec<_> = fields.split_whitespace().collect();
        if fields[0] != "Z" && fields[1] == pid.to_string() {
            children.push(candidate);
        }
    }
    children.sort_unstable();
    children
}
