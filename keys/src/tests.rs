//! Checks, defaults and explanations of a table of two dozen kinds of keys.

use crate::{
    Given, Located, Node, Table, Value, check, check_settings, deserialize, explain, find, markdown, merged, paths,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::de::DeTable;

/// A file.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct File {
    /// Name.
    name: Located<String>,
    /// Settings.
    #[serde(default)]
    #[allow(dead_code, reason = "read by the test as part of the schema")]
    settings: Given<Settings>,
    /// Entries.
    #[serde(default)]
    list: Vec<Entry>,
    /// What is measured.
    measure: Option<Measure>,
}

/// Settings of a program.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
struct Settings {
    /// Factor on something. It grows.
    #[schemars(extend("x-unit" = "-", "exclusiveMinimum" = 0), range(max = 2.0))]
    factor: f64,
    /// Times.
    #[schemars(range(min = 1))]
    count: usize,
    /// Share of the step.
    #[schemars(extend("x-unit" = "-", "x-instead-of" = "step"))]
    share: Option<f64>,
    /// Step.
    #[schemars(extend("x-unit" = "s", "x-instead-of" = "share", "x-procedures" = "dynamic"))]
    step: Option<f64>,
    /// How.
    mode: Mode,
    /// Inner table.
    inner: Inner,
    #[schemars(skip)]
    hidden: Vec<f64>,
}

impl Default for Settings {
    fn default() -> Self {
        let inner = Inner { first: 1.0, second: 2.0 };
        Self { factor: 0.5, count: 3, share: Some(0.9), step: None, mode: Mode::Plain, inner, hidden: vec![1.0] }
    }
}

/// Inner table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
struct Inner {
    /// First.
    #[schemars(extend("x-unit" = "m"))]
    first: f64,
    /// Second.
    #[schemars(extend("x-unit" = "m"))]
    second: f64,
}

/// Modes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Mode {
    /// Nothing special.
    Plain,
    /// With a length.
    Long(Long),
}

/// A length.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Long {
    /// Length.
    #[schemars(extend("x-unit" = "m", "exclusiveMinimum" = 0))]
    length: f64,
}

/// An entry.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Entry {
    /// Set.
    set: Located<String>,
    /// Two numbers.
    #[schemars(extend("x-unit" = "Pa"))]
    pair: Option<[f64; 2]>,
}

/// Told apart by a key.
#[derive(Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
enum Measure {
    /// Of a set.
    Force {
        /// Set.
        set: String,
    },
    /// Of the body.
    Volume,
}

fn node(text: &str) -> Node {
    Node::from(&DeTable::parse(text).unwrap())
}

fn refused(text: &str) -> String {
    let fault = check(&node(text), &Table::of::<File>(), &[]).unwrap_err();
    format!("{} [{}] {}", fault.problem, &text[fault.span.clone()], fault.hint.unwrap_or_default())
}

#[test]
fn a_sound_document_is_read_with_its_places() {
    let text = "name = 'a'\nmeasure = { kind = 'force', set = 'top' }\n[settings]\nfactor = 1\n[[list]]\nset = 'left'\npair = [1, 2.5]";
    let node = node(text);
    check(&node, &Table::of::<File>(), &[]).unwrap();
    let file: File = deserialize(&node).unwrap();
    assert_eq!((file.name.get_ref().as_str(), &text[file.name.span()]), ("a", "'a'"));
    assert_eq!(&text[file.list[0].set.span()], "'left'");
    assert_eq!(file.list[0].pair, Some([1.0, 2.5]));
    assert_eq!(file.measure, Some(Measure::Force { set: "top".into() }));
}

#[test]
fn defects_are_named_with_place_and_remedy() {
    assert!(refused("nam = 'a'").starts_with("unknown key `nam` [nam] did you mean `name`?"));
    assert!(refused("list = []").starts_with("missing key `name`"));
    let settings = |text: &str| refused(&format!("name = 'a'\n[settings]\n{text}"));
    assert_eq!(settings("factor = 0"), "settings.factor must be above 0 and at most 2, not 0 [0] ");
    assert_eq!(
        settings("factor = 'x'"),
        "settings.factor must be a number above 0 and at most 2, not the text \"x\" ['x'] "
    );
    assert_eq!(settings("count = 1.5"), "settings.count must be a whole number at least 1, not 1.5 [1.5] ");
    assert!(settings("step = 1.0\nshare = 0.5").starts_with("`share` and `step` exclude each other [0.5]"));
    assert!(settings("mode = 'plane'").contains("did you mean \"plain\"?"));
    assert!(
        settings("mode = { long = { length = -1 } }")
            .starts_with("settings.mode.long.length must be above 0, not -1 [-1]")
    );
    assert!(settings("mode = { short = 1 }").starts_with("unknown key `short` in settings.mode"));
    assert!(
        settings("inner = { first = 1, second = 2, third = 3 }").starts_with("unknown key `third` in settings.inner")
    );
    assert!(
        refused("name = 'a'\n[[list]]\nset = 'b'\npair = [1]").starts_with("list.0.pair must have 2 entries, not 1")
    );
    assert!(
        refused("name = 'a'\nmeasure = { kind = 'volume', set = 'b' }").starts_with("unknown key `set` in measure")
    );
    assert!(refused("name = 'a'\nmeasure = { kind = 'mass' }").starts_with("measure.kind = \"mass\" is unknown"));
}

#[test]
fn written_keys_replace_those_that_hold_otherwise() {
    let base = Settings { hidden: vec![7.0], ..Settings::default() };
    let table = Table::of::<Settings>();
    let over = |text: &str| merged(&base, &node(text), &table).unwrap();
    assert_eq!(over(""), base);
    assert_eq!(over("factor = 1"), Settings { factor: 1.0, ..base.clone() });
    assert_eq!(over("inner = { second = 5 }").inner, Inner { first: 1.0, second: 5.0 });
    let stepped = over("step = 2.0");
    assert_eq!((stepped.step, stepped.share), (Some(2.0), Some(0.9)), "a key that is left out has its default");
    assert_eq!(over("mode = { long = { length = 2 } }").mode, Mode::Long(Long { length: 2.0 }));
    assert_eq!(over("count = 4").hidden, [7.0]);
}

#[test]
fn settings_of_a_program_are_checked_like_written_ones() {
    let fault = |settings: Settings| check_settings(&settings, &["settings"]).unwrap_err().to_string();
    check_settings(&Settings::default(), &["settings"]).unwrap();
    assert_eq!(fault(Settings { count: 0, ..Settings::default() }), "settings.count must be at least 1, not 0");
    let lost = Settings { factor: f64::NAN, ..Settings::default() };
    assert_eq!(fault(lost), "settings.factor must be a finite number, not NaN");
    let lost = Settings { step: Some(f64::INFINITY), ..Settings::default() };
    assert_eq!(fault(lost), "settings.step must be a finite number, not inf");
}

#[test]
fn keys_are_found_explained_and_listed() {
    let table = Table::of::<File>();
    let (path, entry) = find(&table, "factor").remove(0);
    assert_eq!(path, "settings.factor");
    let text = explain(&path, entry.key);
    for part in ["Factor on something. It grows.", "above 0 and at most 2", "default    0.5", "unit       -"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    assert_eq!(find(&table, "list.3.set").len(), 1);
    assert!(find(&table, "nothing").is_empty());
    let (_, step) = find(&table, "settings.step").remove(0);
    assert_eq!(
        (step.key.procedures.as_slice(), step.key.instead_of.as_deref()),
        (&["dynamic".to_owned()][..], Some("share"))
    );
    assert!(paths(&table).iter().any(|(path, doc)| path == "list.0.set" && doc == "Set"));
    assert!(paths(&table).iter().any(|(path, _)| path == "settings.mode.long.length"));
    let text = markdown(&table);
    assert!(
        text.contains("## `[settings]`") && text.contains("## `[[list]]`") && text.contains("| `inner.first` | m |"),
        "{text}"
    );
    assert!(crate::undocumented(&table).is_empty(), "{:?}", crate::undocumented(&table));
}

#[test]
fn numbers_keep_their_bits_on_the_way() {
    let third = 1.0 / 3.0;
    let node = crate::to_node(&Settings { factor: third, ..Settings::default() }).unwrap();
    assert_eq!(node.get("factor").map(|node| &node.value), Some(&Value::Number(third)));
}

/// A choice with fewer words than its type has.
#[derive(Deserialize, JsonSchema)]
struct Choice {
    /// Colour.
    #[schemars(extend("x-without" = "none"))]
    #[allow(dead_code, reason = "read by the test as part of the schema")]
    colour: Colour,
}

/// Colours.
#[derive(Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Colour {
    /// Without colour.
    None,
    /// Red.
    Red,
    /// Blue.
    Blue,
}

#[test]
fn a_word_of_a_type_can_be_left_out_of_a_key() {
    let table = Table::of::<Choice>();
    assert!(check(&node("colour = 'red'"), &table, &[]).is_ok());
    let fault = check(&node("colour = 'none'"), &table, &[]).unwrap_err();
    assert_eq!(fault.problem, "colour = \"none\" is unknown");
    assert!(fault.hint.unwrap().ends_with("one of \"red\", \"blue\""));
    assert!(!explain("colour", table.key("colour").unwrap()).contains("\"none\""));
}

/// Steps.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
struct Steps {
    /// Number of steps.
    count: usize,
    /// Smallest step.
    #[schemars(extend("x-unit" = "-", "x-most-inverse-of" = "count"))]
    smallest: f64,
}

impl Default for Steps {
    fn default() -> Self {
        Self { count: 4, smallest: 0.25 }
    }
}

#[test]
fn a_key_can_limit_another_one_of_its_table() {
    let table = Table::of::<Steps>();
    let problem = |text: &str| check(&node(text), &table, &["steps"]).map_err(|fault| fault.problem);
    assert_eq!(problem("count = 2\nsmallest = 0.5"), Ok(()));
    assert_eq!(problem("smallest = 0.5"), Ok(()), "the other key may be given elsewhere");
    let expected = "steps.smallest must be at most 1 / count, not 0.5";
    assert_eq!(problem("count = 3\nsmallest = 0.5"), Err(expected.to_owned()));
    let fault = check_settings(&Steps { smallest: 0.5, ..Steps::default() }, &["steps"]).unwrap_err();
    assert_eq!((fault.problem.as_str(), fault.path.join(".").as_str()), (expected, "steps.smallest"));
    assert!(explain("smallest", table.key("smallest").unwrap()).contains("1 / count"));
    assert!(markdown(&table).contains("At most 1 / `count`"));
}

/// A key whose values are words or tables.
#[derive(Deserialize, JsonSchema)]
struct Balance {
    /// How it is balanced.
    #[allow(dead_code, reason = "read by the test as part of the schema")]
    control: Control,
}

/// Ways to balance.
#[derive(Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Control {
    /// At once.
    Direct,
    /// Bit by bit.
    Servo {
        /// How fast.
        #[allow(dead_code, reason = "read by the test as part of the schema")]
        gain: f64,
    },
}

#[test]
fn the_hint_of_an_unknown_word_names_the_table_that_could_stand_there() {
    let table = Table::of::<Balance>();
    assert!(check(&node("control = 'direct'"), &table, &[]).is_ok());
    assert!(check(&node("control = { servo = { gain = 1.0 } }"), &table, &[]).is_ok());
    let fault = check(&node("control = 'servo'"), &table, &[]).unwrap_err();
    assert_eq!(fault.hint.unwrap(), "one of \"direct\", or a table such as { servo = ... }");
}
