//! What a key may hold: the model of a JSON schema that checks, explanations and references share.

use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde_json::Value as Json;

/// A table: keys that belong together.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// What it is for.
    pub doc: String,
    /// Its keys, in alphabetical order, required ones first.
    pub keys: Vec<Key>,
    /// Whether references list its keys with the key that holds it.
    pub folded: bool,
}

/// A key of a table.
#[derive(Clone, Debug, PartialEq)]
pub struct Key {
    /// Its name.
    pub name: String,
    /// What it means.
    pub doc: String,
    /// Unit; `-` for dimensionless numbers, empty where there is nothing to measure.
    pub unit: String,
    /// Whether it has to be given.
    pub required: bool,
    /// Value if it is left out, as TOML text or in words; empty where there is none.
    pub default: String,
    /// What it may hold.
    pub shape: Shape,
    /// Key that excludes this one, in the same table.
    pub instead_of: Option<String>,
    /// Number in the same table of which this one is at most the inverse.
    pub most_inverse_of: Option<String>,
    /// Procedures that use it; empty for all.
    pub procedures: Vec<String>,
    /// Whether it holds for the whole run and cannot be given in a stage.
    pub run_wide: bool,
    /// Its value if its table is written without it, whatever held before.
    pub when_written: Option<bool>,
}

/// What a value may be.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// `true` or `false`.
    Boolean,
    /// A whole number.
    Integer(Bounds),
    /// A number.
    Number(Bounds),
    /// Any text.
    Text,
    /// One of some words.
    Words(Vec<Word>),
    /// One of several.
    Either(Vec<Shape>),
    /// A list.
    List {
        /// What its entries may be.
        of: Box<Shape>,
        /// Fewest and most entries.
        entries: Bounds,
    },
    /// A table of known keys.
    Table(Table),
    /// A table of free keys.
    Map(Box<Shape>),
    /// Anything.
    Anything,
}

/// A word with its meaning.
#[derive(Clone, Debug, PartialEq)]
pub struct Word {
    /// As it is written.
    pub word: String,
    /// What it means.
    pub doc: String,
}

/// Limits of a number.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bounds {
    /// Smallest.
    pub least: Option<f64>,
    /// Largest.
    pub most: Option<f64>,
    /// All are larger.
    pub above: Option<f64>,
    /// All are smaller.
    pub below: Option<f64>,
    /// Whether 0 is excluded.
    pub nonzero: bool,
}

impl Bounds {
    /// Whether a number lies within; NaN never does where there is any limit.
    pub fn contain(&self, number: f64) -> bool {
        self.least.is_none_or(|least| number >= least)
            && self.most.is_none_or(|most| number <= most)
            && self.above.is_none_or(|above| number > above)
            && self.below.is_none_or(|below| number < below)
            && !(self.nonzero && number == 0.0)
    }

    /// The limits in words, such as `above 0 and at most 1`; empty without any.
    pub fn words(&self) -> String {
        let parts = [
            self.above.map(|number| format!("above {}", shown(number))),
            self.least.map(|number| format!("at least {}", shown(number))),
            self.below.map(|number| format!("below {}", shown(number))),
            self.most.map(|number| format!("at most {}", shown(number))),
            self.nonzero.then(|| "other than 0".to_owned()),
        ];
        parts.into_iter().flatten().collect::<Vec<_>>().join(" and ")
    }

    fn of(schema: &Json, [least, most, above, below]: [&str; 4]) -> Self {
        let number = |name: &str| schema.get(name).and_then(Json::as_f64);
        let nonzero = schema.get("x-nonzero").and_then(Json::as_bool) == Some(true);
        Self { least: number(least), most: number(most), above: number(above), below: number(below), nonzero }
    }
}

/// A limit as people write it: without rows of zeros.
fn shown(number: f64) -> String {
    if number != 0.0 && !(1e-3..1e7).contains(&number.abs()) { format!("{number:e}") } else { number.to_string() }
}

const NUMBER: [&str; 4] = ["minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum"];
const ENTRIES: [&str; 4] = ["minItems", "maxItems", "", ""];

/// Largest number of a Rust integer type: as a limit it tells people nothing.
const MACHINE_LIMIT: f64 = 4e9;

impl Table {
    /// The keys of a struct, from its schema. A type that is no struct has none.
    pub fn of<T: JsonSchema>() -> Self {
        let settings = SchemaSettings::draft2020_12().with(|settings| settings.inline_subschemas = true);
        let schema = Json::from(settings.into_generator().into_root_schema_for::<T>());
        match shape(&schema) {
            Shape::Table(table) => table,
            _ => Self { doc: String::new(), keys: Vec::new(), folded: false },
        }
    }

    /// The key of this name.
    pub fn key(&self, name: &str) -> Option<&Key> {
        self.keys.iter().find(|key| key.name == name)
    }
}

impl Shape {
    /// The table, if it is one, or a list of them.
    pub fn table(&self) -> Option<&Table> {
        match self {
            Self::Table(table) => Some(table),
            Self::List { of, .. } => of.table(),
            Self::Boolean
            | Self::Integer(_)
            | Self::Number(_)
            | Self::Text
            | Self::Words(_)
            | Self::Either(_)
            | Self::Map(_)
            | Self::Anything => None,
        }
    }

    /// What it is made of, all under the same key: alternatives, entries of a list, values of free keys. A table has keys instead.
    pub(super) fn parts(&self) -> &[Self] {
        match self {
            Self::Either(shapes) => shapes,
            Self::List { of, .. } | Self::Map(of) => std::slice::from_ref(of),
            Self::Boolean
            | Self::Integer(_)
            | Self::Number(_)
            | Self::Text
            | Self::Words(_)
            | Self::Table(_)
            | Self::Anything => &[],
        }
    }
}

fn shape(schema: &Json) -> Shape {
    if let Some(word) = schema.get("const").and_then(Json::as_str) {
        return Shape::Words(vec![Word { word: word.to_owned(), doc: text(schema, "description") }]);
    }
    if let Some(words) = schema.get("enum").and_then(Json::as_array) {
        let word = |word: &str| Word { word: word.to_owned(), doc: String::new() };
        return Shape::Words(words.iter().filter_map(Json::as_str).map(word).collect());
    }
    if let Some(parts) = ["oneOf", "anyOf"].into_iter().find_map(|name| schema.get(name)?.as_array()) {
        return either(parts, &text(schema, "description"));
    }
    match kind(schema) {
        "boolean" => Shape::Boolean,
        "integer" => Shape::Integer(machine_limits_removed(Bounds::of(schema, NUMBER))),
        "number" => Shape::Number(Bounds::of(schema, NUMBER)),
        "string" => Shape::Text,
        "array" => list(schema),
        "object" => table(schema),
        _ => Shape::Anything,
    }
}

/// The type of a schema, `null` left out: a key that is not given says so already.
fn kind(schema: &Json) -> &str {
    match schema.get("type") {
        Some(Json::String(kind)) => kind,
        Some(Json::Array(kinds)) => kinds.iter().filter_map(Json::as_str).find(|kind| *kind != "null").unwrap_or(""),
        _ => "",
    }
}

fn machine_limits_removed(bounds: Bounds) -> Bounds {
    let within = |limit: Option<f64>| limit.filter(|limit| limit.abs() < MACHINE_LIMIT);
    Bounds { least: within(bounds.least), most: within(bounds.most), ..bounds }
}

fn either(parts: &[Json], doc: &str) -> Shape {
    let mut words = Vec::new();
    let mut others = Vec::new();
    for part in parts.iter().filter(|part| part.get("type").and_then(Json::as_str) != Some("null")) {
        match shape(part) {
            Shape::Words(found) => words.extend(found),
            Shape::Table(mut table) => {
                describe_alternative(&mut table, &text(part, "x-unit"));
                others.push(Shape::Table(table));
            }
            other => others.push(other),
        }
    }
    if !words.is_empty() {
        others.insert(0, Shape::Words(words));
    }
    match others.len() {
        1 => {
            let mut only = others.remove(0);
            if let Shape::Table(table) = &mut only
                && !doc.is_empty()
            {
                doc.clone_into(&mut table.doc);
            }
            only
        }
        _ => Shape::Either(others),
    }
}

/// Gives the key that tells an alternative from the others, its tag or its only key, the documentation of the alternative. An only
/// key is required of nobody: there are the others.
fn describe_alternative(table: &mut Table, unit: &str) {
    let is_only = table.keys.len() == 1;
    for key in &mut table.keys {
        let is_tag = matches!(&key.shape, Shape::Words(words) if words.len() == 1);
        if (is_tag || is_only) && key.doc.is_empty() {
            table.doc.clone_into(&mut key.doc);
        }
        if is_only && !is_tag {
            key.required = false;
            if key.unit.is_empty() {
                unit.clone_into(&mut key.unit);
                inherit_unit(&mut key.shape, unit);
            }
        }
    }
}

fn list(schema: &Json) -> Shape {
    let entries = Bounds::of(schema, ENTRIES);
    let of = schema.get("items").or_else(|| schema.get("prefixItems")?.get(0)).map_or(Shape::Anything, shape);
    Shape::List { of: Box::new(of), entries }
}

fn table(schema: &Json) -> Shape {
    let Some(properties) = schema.get("properties").and_then(Json::as_object) else {
        return match schema.get("additionalProperties") {
            Some(values @ Json::Object(_)) => Shape::Map(Box::new(shape(values))),
            // A struct without fields.
            Some(Json::Bool(false)) => {
                Shape::Table(Table { doc: text(schema, "description"), keys: Vec::new(), folded: false })
            }
            _ => Shape::Anything,
        };
    };
    let required: Vec<&str> =
        schema.get("required").and_then(Json::as_array).into_iter().flatten().filter_map(Json::as_str).collect();
    let mut keys: Vec<Key> =
        properties.iter().map(|(name, schema)| key(name, schema, required.contains(&name.as_str()))).collect();
    keys.sort_by(|one, other| other.required.cmp(&one.required).then_with(|| one.name.cmp(&other.name)));
    let folded = schema.get("x-folded").and_then(Json::as_bool) == Some(true);
    Shape::Table(Table { doc: text(schema, "description"), keys, folded })
}

fn key(name: &str, schema: &Json, required: bool) -> Key {
    let default = match (schema.get("x-default").and_then(Json::as_str), schema.get("default")) {
        (Some(words), _) => words.to_owned(),
        (None, Some(value)) => written(value),
        (None, None) => String::new(),
    };
    let mut key = Key {
        name: name.to_owned(),
        doc: text(schema, "description"),
        unit: text(schema, "x-unit"),
        required,
        default,
        shape: shape(schema),
        instead_of: schema.get("x-instead-of").and_then(Json::as_str).map(str::to_owned),
        most_inverse_of: schema.get("x-most-inverse-of").and_then(Json::as_str).map(str::to_owned),
        procedures: text(schema, "x-procedures").split_whitespace().map(str::to_owned).collect(),
        run_wide: schema.get("x-scope").and_then(Json::as_str) == Some("run"),
        when_written: schema.get("x-when-written").and_then(Json::as_bool),
    };
    if let (Shape::Words(words), without) = (&mut key.shape, text(schema, "x-without")) {
        words.retain(|word| word.word != without);
    }
    inherit_unit(&mut key.shape, &key.unit);
    key
}

/// Numbers in a table have the unit of the key that holds it, unless they say otherwise.
fn inherit_unit(shape: &mut Shape, unit: &str) {
    match shape {
        Shape::Table(table) => {
            for key in table.keys.iter_mut().filter(|key| key.unit.is_empty()) {
                unit.clone_into(&mut key.unit);
                inherit_unit(&mut key.shape, unit);
            }
        }
        Shape::List { of, .. } | Shape::Map(of) => inherit_unit(of, unit),
        Shape::Either(shapes) => shapes.iter_mut().for_each(|shape| inherit_unit(shape, unit)),
        Shape::Boolean | Shape::Integer(_) | Shape::Number(_) | Shape::Text | Shape::Words(_) | Shape::Anything => {}
    }
}

/// A value as TOML writes it; nothing for tables and lists of them, whose keys have defaults of their own.
fn written(value: &Json) -> String {
    match value {
        Json::Null | Json::Object(_) => String::new(),
        Json::Array(entries) if entries.is_empty() => String::new(),
        Json::Array(entries) => format!("[{}]", entries.iter().map(written).collect::<Vec<_>>().join(", ")),
        Json::Number(number) => match number.as_f64() {
            Some(float) if number.is_f64() && float != 0.0 && !(1e-3..1e6).contains(&float.abs()) => {
                format!("{float:e}")
            }
            Some(float) => format!("{float}"),
            None => number.to_string(),
        },
        other => other.to_string(),
    }
}

/// A property in one line: line breaks of the source mean nothing.
fn text(schema: &Json, name: &str) -> String {
    let text = schema.get(name).and_then(Json::as_str).unwrap_or_default();
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
