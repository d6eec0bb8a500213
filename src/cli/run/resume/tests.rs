//! Where runs begin: folders of other runs, damaged ones, complete ones, and of other builds.

use super::*;

fn note(scene: &str) -> RunDescription {
    let contents = Contents {
        definition: "definition".into(),
        mesh: "a".into(),
        engines: "grains (0 to 3)".into(),
        ..Contents::default()
    };
    RunDescription::new(scene, contents)
}

/// A folder with a checkpoint of the scene `a = 1`, and another text in `scene.toml`.
fn damaged() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut archive = Archive::new();
    let mark = Progress { step: 1, stage: 0, load: 0.5 };
    let hosts = HostFigures::from([("agents_lost".to_owned(), 2)]);
    note("a = 1").put(&mut archive, mark, 1.0, &CheckpointFigures::default(), hosts);
    CheckpointFile::in_folder(folder.path()).write(&archive).unwrap();
    fs::write(folder.path().join("scene.toml"), "b = 1").unwrap();
    folder
}

#[test]
fn a_damaged_scene_is_restored_from_the_checkpoint() {
    let folder = damaged();
    let Start::From(continued) = start(folder.path(), &note("a = 1"), &[]).unwrap() else { panic!("not continued") };
    assert!(continued.remarks.iter().any(|remark| remark.contains("restored from")), "{:?}", continued.remarks);
    assert_eq!(fs::read_to_string(folder.path().join("scene.toml")).unwrap(), "a = 1");
}

/// Agents that an earlier process of the run had lost were none in its summary.
#[test]
fn what_happened_between_hosts_is_counted_over_all_processes() {
    let folder = damaged();
    let Start::From(continued) = start(folder.path(), &note("a = 1"), &[]).unwrap() else { panic!("not continued") };
    let later = [("agents_lost", 1), ("agents_joined", 3)].map(|(name, count)| (name.to_owned(), count));
    let all = added_up(continued.description.hosts, later.into());
    assert_eq!((all["agents_lost"], all["agents_joined"]), (3, 3));
}

/// The remedy must not name the file that is damaged as the one to continue with.
#[test]
fn a_refusal_does_not_name_a_scene_that_is_not_the_one_of_the_run() {
    let folder = damaged();
    let refused = |folder: &Path| match start(folder, &note("b = 1"), &[]) {
        Err(failure) => failure.message,
        Ok(_) => panic!("continued with another scene"),
    };
    let text = refused(folder.path());
    assert!(text.contains("is damaged") && !text.contains("continue it with the scene as it was, "), "{text}");
    fs::write(folder.path().join("scene.toml"), "a = 1").unwrap();
    let text = refused(folder.path());
    assert!(
        text.contains("continue it with the scene as it was, ") && text.contains("scene.toml with --out"),
        "{text}"
    );
    CheckpointFile::in_folder(folder.path()).remove().unwrap();
    assert!(refused(folder.path()).contains("without --resume"));
}

#[test]
fn a_damaged_checkpoint_without_another_one_comes_with_the_remedy() {
    let folder = damaged();
    fs::write(
        folder.path().join("checkpoint.bin"),
        "no checkpoint, but longer than the header of one would have to be",
    )
    .unwrap();
    let failure = start(folder.path(), &note("a = 1"), &[]).err().expect("it is refused");
    assert!(failure.message.contains("hint: no whole checkpoint is left"), "{}", failure.message);
}

#[test]
fn another_mesh_and_other_engines_are_refused() {
    let folder = damaged();
    fs::write(folder.path().join("scene.toml"), "a = 1").unwrap();
    let refused = |change: fn(&mut Contents)| {
        let mut description = note("a = 1");
        change(&mut description.contents);
        start(folder.path(), &description, &[]).err().expect("it is refused").message
    };
    let text = refused(|contents| contents.mesh = "b".into());
    assert!(text.contains("mesh.file: the content is not the same"), "{text}");
    let text = refused(|contents| contents.engines = "yade (0 to 3)".into());
    assert!(text.contains("--engine: the points were solved by grains (0 to 3) and are by yade (0 to 3)"), "{text}");
    let text = refused(|contents| contents.definition = "another".into());
    assert!(text.contains("packing: the content of the packing file is not the same"), "{text}");
}

/// A run that has ended has no checkpoint: its copies of the files tell whether it was the same run.
#[test]
fn another_file_of_a_run_without_a_checkpoint_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("scene.toml"), "a = 1").unwrap();
    let mesh = |text: &str| InputCopy { key: "mesh.file".into(), name: "mesh.msh".into(), text: text.into() };
    let started = |text: &str| start(folder.path(), &note("a = 1"), &[&mesh(text)]);
    let refused = |text: &str| started(text).err().expect("it is refused").message;
    assert!(refused("one").contains("mesh.file: the content is not that of mesh.msh"));
    fs::write(folder.path().join("mesh.msh"), "one").unwrap();
    assert!(matches!(started("one"), Ok(Start::Beginning)));
    assert!(refused("two").contains("mesh.file: the content is not that of mesh.msh"));
}

/// A complete run has no checkpoint: its summary says what it was made of.
#[test]
fn a_summary_tells_what_a_complete_run_was_made_of() {
    let now = note("a = 1").contents;
    let changed = |versions: &BTreeMap<String, String>| now.changes(&Contents::of_summary(versions, &now));
    assert!(changed(&now.recorded().collect()).is_empty());
    assert!(changed(&BTreeMap::new()).is_empty(), "of an earlier build");
    let before = Contents { mesh: "b".into(), engines: "yade (0 to 3)".into(), ..now.clone() };
    let found = changed(&before.recorded().collect());
    assert!(found.len() == 2 && found[0].contains("mesh.file") && found[1].contains("yade (0 to 3)"), "{found:?}");
    assert!(Contents::default().recorded().next().is_none());
}

/// A was continued by B, and B by B: the run is not one of a single build.
#[test]
fn a_change_of_the_build_is_remembered_at_the_next_continuation() {
    let folder = damaged();
    fs::write(folder.path().join("scene.toml"), "a = 1").unwrap();
    let mark = Progress { step: 1, stage: 0, load: 0.5 };
    let continued = |program: &str| {
        let now = RunDescription { program: program.to_owned(), ..note("a = 1") };
        let Start::From(continued) = start(folder.path(), &now, &[]).unwrap() else { panic!("not continued") };
        let mut archive = Archive::new();
        now.of(Some(&continued)).put(&mut archive, mark, 1.0, &CheckpointFigures::default(), HostFigures::default());
        CheckpointFile::in_folder(folder.path()).write(&archive).unwrap();
        (continued.other_build, continued.remarks.len())
    };
    assert_eq!(continued(&this_program()), (false, 0));
    assert_eq!(continued("another"), (true, 1));
    assert_eq!(continued("another"), (true, 0));
}

#[test]
fn another_version_of_an_engine_outside_is_remarked_and_counts_as_another_build() {
    let folder = damaged();
    fs::write(folder.path().join("scene.toml"), "a = 1").unwrap();
    let mut now = note("a = 1");
    now.contents.versions = "mine 2".into();
    let Start::From(continued) = start(folder.path(), &now, &[]).unwrap() else { panic!("not continued") };
    assert!(continued.other_build);
    assert!(continued.remarks.iter().any(|remark| remark.contains("now mine 2")), "{:?}", continued.remarks);
}

#[test]
fn keys_that_may_change_between_processes_are_no_damage() {
    let folder = damaged();
    fs::write(folder.path().join("scene.toml"), "a = 1\n[pool]\nslice = 2").unwrap();
    let Start::From(continued) = start(folder.path(), &note("a = 1"), &[]).unwrap() else { panic!("not continued") };
    assert!(continued.remarks.is_empty(), "{:?}", continued.remarks);
}

/// Preparing cells takes minutes: what else may be wrong is known before, and a complete run needs none of it.
#[test]
fn a_run_that_prepares_cells_is_compared_before_they_are_there() {
    let unprepared = |scene: &str| {
        let mut description = note(scene);
        description.contents.definition = String::new();
        description
    };
    let folder = damaged();
    let refused = start(folder.path(), &unprepared("c = 1"), &[]).err().expect("it is refused");
    assert!(refused.message.contains("another scene"), "{}", refused.message);
    let Start::From(continued) = start(folder.path(), &unprepared("a = 1"), &[]).unwrap() else {
        panic!("not continued")
    };
    continued.expect_definition(folder.path(), &note("a = 1").contents).unwrap();
    let other = Contents { definition: "another".into(), ..note("a = 1").contents };
    let refused = continued.expect_definition(folder.path(), &other).unwrap_err();
    assert!(refused.message.contains("packing: the content"), "{}", refused.message);
    // A complete run.
    CheckpointFile::in_folder(folder.path()).remove().unwrap();
    let versions: BTreeMap<String, String> = note("a = 1").contents.recorded().collect();
    let now = unprepared("a = 1").contents;
    assert!(now.changes(&Contents::of_summary(&versions, &now)).is_empty());
}
