//! What a run may use and who may see it: limits with clear errors, memory of the owner only, nothing left behind.

use protocol::transport::TransportError;
use protocol::transport::shared_memory::{ChannelLimits, SharedMemoryMacroPort, SharedMemoryWorkerPort};
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::PathBuf;
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(5);

fn segments(prefix: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir("/dev/shm").unwrap().flatten();
    entries.filter(|one| one.file_name().to_string_lossy().starts_with(prefix)).map(|one| one.path()).collect()
}

#[test]
fn one_worker_too_many_is_told_the_limit() {
    let run = format!("full{}", std::process::id());
    let limits = ChannelLimits { workers: 2, ..ChannelLimits::default() };
    let _port = SharedMemoryMacroPort::create(&run, limits).unwrap();
    let first = SharedMemoryWorkerPort::join(&run, PATIENCE).unwrap();
    let _second = SharedMemoryWorkerPort::join(&run, PATIENCE).unwrap();
    let refused = SharedMemoryWorkerPort::join(&run, Duration::ZERO).err().unwrap();
    assert!(matches!(refused, TransportError::NoRoom { limit: 2 }), "{refused}");
    assert!(refused.to_string().contains("2 is the most"), "{refused}");
    // A place that becomes free is taken.
    drop(first);
    SharedMemoryWorkerPort::join(&run, PATIENCE).unwrap();
}

#[test]
fn a_message_beyond_the_room_in_memory_is_refused_before_it_is_written() {
    let run = format!("huge{}", std::process::id());
    let limits = ChannelLimits { message_bytes: 1 << 44, workers: 1, ..ChannelLimits::default() };
    // Either the reservation or the message is refused, in words; nobody is ended by a signal.
    let refused = SharedMemoryMacroPort::create(&run, limits).err().map(|error| error.to_string());
    assert!(refused.is_some_and(|text| !text.is_empty()));
}

#[test]
fn memory_of_a_run_belongs_to_its_owner_alone_and_goes_with_it() {
    let run = format!("private{}", std::process::id());
    let port = SharedMemoryMacroPort::create(&run, ChannelLimits::default()).unwrap();
    let worker = SharedMemoryWorkerPort::join(&run, PATIENCE).unwrap();
    let (prefix, root) = (port.record().prefix.clone(), port.record().root.clone());
    let found = segments(&prefix);
    assert!(found.len() >= 4, "{found:?}");
    for path in &found {
        let mode = fs::metadata(path).unwrap().mode() & 0o777;
        assert_eq!(mode & 0o077, 0, "{} has mode {mode:o}", path.display());
    }
    // Sockets and files of the run lie below a directory that nobody else may enter.
    let directory = root.parent().unwrap().to_owned();
    for path in [directory.parent().unwrap(), &directory, &root] {
        let metadata = fs::metadata(path).unwrap();
        assert_eq!(metadata.mode() & 0o777, 0o700, "{}", path.display());
        assert_eq!(metadata.uid(), rustix::process::getuid().as_raw());
    }
    drop((worker, port));
    assert_eq!((segments(&prefix), directory.exists()), (Vec::new(), false));
}
