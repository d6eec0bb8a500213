//! What a run's folder keeps, refuses and leaves behind.

use super::*;

/// A run name that no other test of any process uses.
fn name() -> String {
    format!("t{:x}", fresh_number())
}

fn exists(name: &str) -> bool {
    base_path().join(name).exists()
}

#[test]
fn a_run_is_found_by_name_once_announced_and_gone_when_dropped() {
    let name = name();
    let mut run = RunDirectory::create(&name, ChannelLimits::default()).unwrap();
    assert_eq!(RunDirectory::open(&name).unwrap(), None);
    assert_eq!(RunDirectory::find(&name).unwrap(), None);
    run.announce().unwrap();
    assert_eq!(RunDirectory::open(&name).unwrap().as_ref(), Some(run.record()));
    assert_eq!(RunDirectory::find(&name).unwrap().as_ref(), Some(run.record()));
    assert!(RunDirectory::list().unwrap().iter().any(|listing| listing.name == name && listing.alive));
    assert!(!RunDirectory::remove(&name).unwrap(), "a living run was removed");
    let taken = RunDirectory::create(&name, ChannelLimits::default()).unwrap_err();
    assert!(matches!(taken, RunError::Taken { .. }), "{taken}");
    let mode = fs::metadata(&run.directory).unwrap().mode() & 0o777;
    assert_eq!(mode, 0o700);
    drop(run);
    assert!(!exists(&name));
    assert!(matches!(RunDirectory::open(&name), Err(RunError::Unknown { .. })));
    assert_eq!(RunDirectory::find(&name).unwrap(), None);
}

#[test]
fn a_dead_run_is_told_from_a_later_process_with_its_number_and_is_removed() {
    let name = name();
    let mut run = RunDirectory::create(&name, ChannelLimits::default()).unwrap();
    run.record.pid_started += 1;
    run.announce().unwrap();
    let segment = Path::new(SHARED_MEMORY).join(format!("{}left", run.record.prefix));
    fs::write(&segment, b"x").unwrap();
    assert!(matches!(RunDirectory::open(&name), Err(RunError::Unknown { .. })));
    assert!(RunDirectory::remove(&name).unwrap());
    assert!(!segment.exists() && !exists(&name));
}

/// Several workers of a dead run remove it, and its user starts it again at once.
#[test]
fn a_run_that_begins_between_the_look_at_a_dead_one_and_its_removal_is_left_alone() {
    let name = name();
    let mut dead = RunDirectory::create(&name, ChannelLimits::default()).unwrap();
    dead.record.pid_started += 1;
    dead.announce().unwrap();
    let found = look_at(&base_path(), &name);
    assert!(!found.alive);
    assert!(RunDirectory::remove(&name).unwrap());
    drop(dead);
    let mut run = RunDirectory::create(&name, ChannelLimits::default()).unwrap();
    run.announce().unwrap();
    let segment = Path::new(SHARED_MEMORY).join(format!("{}node", run.record.prefix));
    fs::write(&segment, b"x").unwrap();
    assert!(!remove_dead(&base_path(), &found), "the run of this name lives");
    assert_eq!(RunDirectory::find(&name).unwrap().as_ref(), Some(run.record()));
    assert!(segment.exists() && run.record.root.exists());
    drop(run);
    assert!(!segment.exists() && remove_dead(&base_path(), &found), "nothing is left to be removed");
}

/// A folder without a record, as a removal leaves it that has moved the folder of a beginning run aside and back.
#[test]
fn a_folder_without_a_record_is_waited_for_and_taken_when_nobody_completes_it() {
    let (left, completed) = (name(), name());
    base_directory().unwrap();
    for name in [&left, &completed] {
        let folder = base_path().join(name);
        make_private_directory(&folder).unwrap();
        let young = SystemTime::now() - BIRTH + Duration::from_millis(500);
        File::open(&folder).unwrap().set_modified(young).unwrap();
    }
    let other = RunDirectory::create(&name(), ChannelLimits::default()).unwrap();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            std::thread::sleep(Duration::from_millis(100));
            fs::copy(other.directory.join("run.json"), base_path().join(&completed).join("run.json")).unwrap();
        });
        let taken = RunDirectory::create(&completed, ChannelLimits::default()).unwrap_err();
        assert!(matches!(taken, RunError::Taken { pid, .. } if pid == std::process::id()), "{taken}");
    });
    fs::remove_dir_all(base_path().join(&completed)).unwrap();
    let run = RunDirectory::create(&left, ChannelLimits::default()).unwrap();
    assert_eq!(run.record().name, left);
}

#[test]
fn more_than_there_is_is_refused_with_the_remedy() {
    check_room(0).unwrap();
    let text = check_room(1 << 60).unwrap_err().to_string();
    assert!(text.contains("shared memory is full") && text.contains("--shm-size"), "{text}");
}

#[test]
fn what_a_late_worker_has_made_goes_with_it_unless_the_run_lives() {
    let name = name();
    let run = RunDirectory::create(&name, ChannelLimits::default()).unwrap();
    let (record, directory) = (run.record().clone(), run.directory.clone());
    drop(CleanupAfterEnd(record.clone()));
    assert!(exists(&name), "the run lives");
    drop(run);
    fs::create_dir_all(&record.root).unwrap();
    drop(CleanupAfterEnd(record));
    assert!(!directory.exists());
}

/// Two containers that share `/dev/shm` do not see each other's processes.
#[test]
fn a_run_of_another_pid_namespace_is_judged_by_its_lock() {
    let name = name();
    let mut run = RunDirectory::create(&name, ChannelLimits::default()).unwrap();
    assert!(!run.record.is_foreign());
    // No process here has this number: judged by numbers the run would be dead.
    run.record.pid_namespace = Some("pid:[1]".to_owned());
    run.record.pid_started += 1;
    run.announce().unwrap();
    assert!(run.record.is_foreign() && run.record.is_alive());
    assert!(!RunDirectory::remove(&name).unwrap(), "a living run of another container was removed");
    run._lock.unlock().unwrap();
    assert!(!run.record.is_alive());
    assert!(RunDirectory::remove(&name).unwrap());
}

#[test]
fn segments_that_no_run_claims_are_removed_and_those_of_runs_and_fresh_ones_stay() {
    let run = RunDirectory::create(&name(), ChannelLimits::default()).unwrap();
    let stranger = format!("g{:08x}_", fresh_number() as u32);
    let place = |prefix: &str, end: &str| Path::new(SHARED_MEMORY).join(format!("{prefix}{end}"));
    let old = SystemTime::now() - 2 * BIRTH;
    let make = |path: &Path, time: SystemTime| {
        fs::write(path, b"x").unwrap();
        File::options().write(true).open(path).unwrap().set_modified(time).unwrap();
    };
    let (orphan, fresh) = (place(&stranger, "orphan"), place(&stranger, "fresh"));
    let (claimed, foreign) = (place(&run.record.prefix, "claimed"), place("gardening_", &stranger));
    make(&fresh, SystemTime::now());
    [&orphan, &claimed, &foreign].into_iter().for_each(|path| make(path, old));
    assert!(remove_orphans().contains(&format!("{stranger}*")));
    assert!(!orphan.exists() && fresh.exists() && claimed.exists() && foreign.exists());
    [&fresh, &claimed, &foreign].into_iter().for_each(|path| fs::remove_file(path).unwrap());
}

#[test]
fn a_directory_that_others_may_write_to_is_refused_with_the_remedy() {
    let place = std::env::temp_dir().join(name());
    make_private_directory(&place).unwrap();
    check_private(&place).unwrap();
    fs::set_permissions(&place, fs::Permissions::from_mode(0o777)).unwrap();
    let text = check_private(&place).unwrap_err().to_string();
    assert!(text.contains("mode 777") && text.contains("chmod 700"), "{text}");
    fs::remove_dir(&place).unwrap();
}

/// A worker that closes its channels after the run was removed makes a segment anew, without the directory.
#[test]
fn a_segment_that_comes_back_alone_goes_too_even_when_a_run_has_the_name_again() {
    let name = name();
    let run = RunDirectory::create(&name, ChannelLimits::default()).unwrap();
    let (record, own) = (run.record().clone(), CleanupAfterEnd(run.record().clone()));
    drop(run);
    let segment = Path::new(SHARED_MEMORY).join(format!("{}node.global_mgmt", record.prefix));
    fs::write(&segment, b"x").unwrap();
    drop(own);
    assert!(!segment.exists());
    let again = RunDirectory::create(&name, ChannelLimits::default()).unwrap();
    fs::write(&segment, b"x").unwrap();
    drop(CleanupAfterEnd(record));
    assert!(!segment.exists() && exists(&name));
    drop(again);
}

#[test]
fn another_version_is_refused_with_both_versions_and_the_remedy() {
    let name = name();
    let mut run = RunDirectory::create(&name, ChannelLimits::default()).unwrap();
    run.record.protocol = 99;
    run.announce().unwrap();
    let text = RunDirectory::open(&name).unwrap_err().to_string();
    for part in ["protocol 99", &format!("protocol {PROTOCOL_VERSION}"), "same build"] {
        assert!(text.contains(part), "{text}");
    }
}

#[test]
fn unusable_names_are_refused() {
    for bad in ["", "a/b", "../x", ".hidden", "with space", &"long".repeat(20)] {
        let error = RunDirectory::create(bad, ChannelLimits::default()).unwrap_err();
        assert!(matches!(error, RunError::Name { .. }), "{error}");
    }
}

/// The folder of all runs is removed with the last of them, at any moment, and another process may be about to make its own in it.
#[test]
fn runs_begin_while_others_end_and_take_the_folder_of_all_runs_with_them() {
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                for _ in 0..250 {
                    drop(RunDirectory::create(&name(), ChannelLimits::default()).unwrap());
                    RunDirectory::list().unwrap();
                }
            });
        }
    });
}
