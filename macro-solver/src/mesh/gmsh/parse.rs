//! From the lines of a file to nodes, elements and groups as Gmsh numbers them.

use super::GmshError;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::str::FromStr;

/// What a file holds.
#[derive(Debug, Default)]
pub(super) struct Content {
    /// Position of every node by its tag, m.
    pub(super) nodes: BTreeMap<u64, [f64; 3]>,
    /// Line of every node by its tag.
    pub(super) node_lines: BTreeMap<u64, usize>,
    /// All elements, in the order of the file.
    pub(super) elements: Vec<RawElement>,
    /// Names of groups by dimension and tag.
    pub(super) names: BTreeMap<(usize, i64), String>,
    /// Groups of geometric entities by dimension and tag, format 4.1.
    entities: BTreeMap<(usize, i64), Vec<i64>>,
    /// Lines of the file.
    pub(super) lines: usize,
}

/// One element.
#[derive(Debug)]
pub(super) struct RawElement {
    /// Where it stands.
    pub(super) line: usize,
    /// Gmsh's number of it.
    pub(super) tag: u64,
    /// Gmsh's number of its shape.
    pub(super) shape: u32,
    /// Physical groups.
    pub(super) groups: Vec<i64>,
    /// Node tags in Gmsh's order.
    pub(super) nodes: Vec<u64>,
}

/// Reads all sections; unknown ones are skipped.
pub(super) fn parse(text: &str) -> Result<Content, GmshError> {
    let mut lines = Lines { lines: text.lines().collect(), next: 0 };
    let mut content = Content { lines: lines.lines.len().max(1), ..Content::default() };
    let mut format = None;
    while let Some(line) = lines.advance() {
        let name = line.text.trim();
        if name.is_empty() {
            continue;
        }
        let Some(section) = name.strip_prefix('$') else {
            return Err(
                line.error(format!("'{}' is not the start of a section", shorten(name)), "is it a Gmsh file?")
            );
        };
        let is_read = matches!(section, "PhysicalNames" | "Entities" | "Nodes" | "Elements");
        match (section, format) {
            ("MeshFormat", _) => format = Some(mesh_format(&mut lines)?),
            ("PhysicalNames", _) => physical_names(&mut lines, &mut content)?,
            ("Entities", Some(Format::Four)) => entities(&mut lines, &mut content)?,
            ("Nodes", Some(Format::Two)) => nodes_two(&mut lines, &mut content)?,
            ("Nodes", Some(Format::Four)) => nodes_four(&mut lines, &mut content)?,
            ("Elements", Some(Format::Two)) => elements_two(&mut lines, &mut content)?,
            ("Elements", Some(Format::Four)) => elements_four(&mut lines, &mut content)?,
            ("Nodes" | "Elements" | "Entities", None) => {
                return Err(line.error("there is no $MeshFormat before this section", SAVE_AGAIN));
            }
            ("PartitionedEntities", _) => {
                return Err(line.error("the mesh is partitioned", "save it without partitions"));
            }
            _ => {}
        }
        if is_read {
            lines.expect_end(section)?;
        } else {
            lines.skip_to_end(section)?;
        }
    }
    if format.is_none() {
        return Err(GmshError::new(1, "there is no $MeshFormat section", SAVE_AGAIN));
    }
    Ok(content)
}

const SAVE_AGAIN: &str = "save the mesh from Gmsh as ASCII in format 4.1 or 2.2";

#[derive(Clone, Copy)]
enum Format {
    Two,
    Four,
}

fn mesh_format(lines: &mut Lines<'_>) -> Result<Format, GmshError> {
    let line = lines.expect()?;
    let mut words = line.words();
    let version: String = words.next("the format's version")?;
    let binary: u32 = words.next("the kind of file")?;
    if binary != 0 {
        return Err(line.error("the file is binary", "save it as ASCII: gmsh -save FILE -format msh41 -bin 0"));
    }
    match version.as_str() {
        "2.2" | "2.1" | "2" => Ok(Format::Two),
        "4.1" => Ok(Format::Four),
        other => Err(line.error(format!("format {other} is not read"), SAVE_AGAIN)),
    }
}

fn physical_names(lines: &mut Lines<'_>, content: &mut Content) -> Result<(), GmshError> {
    for _ in 0..lines.count()? {
        let line = lines.expect()?;
        let mut words = line.words();
        let key = (words.next("a dimension")?, words.next("a group")?);
        let quoted = line.text.split('"').nth(1).filter(|name| !name.is_empty());
        let name = quoted.ok_or_else(|| line.error("the group has no name in quotes", SAVE_AGAIN))?;
        content.names.insert(key, name.to_owned());
    }
    Ok(())
}

fn entities(lines: &mut Lines<'_>, content: &mut Content) -> Result<(), GmshError> {
    let line = lines.expect()?;
    let mut words = line.words();
    let counts: Vec<usize> = (0..4).map(|_| words.next("a number of entities")).collect::<Result<_, _>>()?;
    for (dimension, count) in counts.into_iter().enumerate() {
        for _ in 0..count {
            let line = lines.expect()?;
            let mut words = line.words();
            let tag: i64 = words.next("an entity")?;
            // A point has its position, everything else its bounding box.
            for _ in 0..if dimension == 0 { 3 } else { 6 } {
                words.next::<f64>("a coordinate")?;
            }
            let groups: usize = words.next("a number of groups")?;
            // The sign is the orientation that the group wants of the entity.
            let groups: Vec<i64> = (0..groups).map(|_| words.next("a group")).collect::<Result<_, _>>()?;
            let groups = groups.into_iter().map(i64::abs).collect();
            content.entities.insert((dimension, tag), groups);
        }
    }
    Ok(())
}

fn nodes_two(lines: &mut Lines<'_>, content: &mut Content) -> Result<(), GmshError> {
    for _ in 0..lines.count()? {
        let line = lines.expect()?;
        let mut words = line.words();
        let tag = words.next("a node")?;
        add_node(content, &line, tag, position(&mut words)?)?;
    }
    Ok(())
}

fn nodes_four(lines: &mut Lines<'_>, content: &mut Content) -> Result<(), GmshError> {
    for _ in 0..lines.count()? {
        let line = lines.expect()?;
        let mut words = line.words();
        let _entity: (usize, i64) = (words.next("a dimension")?, words.next("an entity")?);
        let _parametric: u32 = words.next("0 or 1")?;
        let count: usize = words.next("a number of nodes")?;
        let mut tags = Vec::new();
        for _ in 0..count {
            tags.push(lines.expect()?.words().next("a node")?);
        }
        for tag in tags {
            let line = lines.expect()?;
            let place = position(&mut line.words())?;
            add_node(content, &line, tag, place)?;
        }
    }
    Ok(())
}

fn add_node(content: &mut Content, line: &Line<'_>, tag: u64, place: [f64; 3]) -> Result<(), GmshError> {
    if !place.iter().all(|x| x.is_finite()) {
        return Err(line.error(format!("node {tag} has a coordinate that is not a finite number"), SAVE_AGAIN));
    }
    content.node_lines.insert(tag, line.number);
    match content.nodes.insert(tag, place) {
        Some(_) => Err(line.error(format!("node {tag} is given twice"), SAVE_AGAIN)),
        None => Ok(()),
    }
}

fn position(words: &mut Words<'_>) -> Result<[f64; 3], GmshError> {
    Ok([words.next("x")?, words.next("y")?, words.next("z")?])
}

fn elements_two(lines: &mut Lines<'_>, content: &mut Content) -> Result<(), GmshError> {
    // An element of several groups stands there once for each of them.
    let mut places: BTreeMap<(u32, Vec<u64>), usize> = BTreeMap::new();
    for _ in 0..lines.count()? {
        let line = lines.expect()?;
        let mut words = line.words();
        let tag = words.next("an element")?;
        let shape = words.next("a shape")?;
        let tags: usize = words.next("a number of tags")?;
        let tags: Vec<i64> = (0..tags).map(|_| words.next("a tag")).collect::<Result<_, _>>()?;
        // The first tag is the group, 0 for none.
        let group = tags.first().map(|group| group.abs()).filter(|group| *group != 0);
        let nodes: Vec<u64> = words.rest("a node")?;
        match places.entry((shape, nodes.clone())) {
            Entry::Occupied(place) => content.elements[*place.get()].groups.extend(group),
            Entry::Vacant(place) => {
                place.insert(content.elements.len());
                content.elements.push(RawElement {
                    line: line.number,
                    tag,
                    shape,
                    groups: group.into_iter().collect(),
                    nodes,
                });
            }
        }
    }
    Ok(())
}

fn elements_four(lines: &mut Lines<'_>, content: &mut Content) -> Result<(), GmshError> {
    for _ in 0..lines.count()? {
        let line = lines.expect()?;
        let mut words = line.words();
        let entity = (words.next("a dimension")?, words.next("an entity")?);
        let shape = words.next("a shape")?;
        let count: usize = words.next("a number of elements")?;
        let groups = content.entities.get(&entity).cloned().unwrap_or_default();
        for _ in 0..count {
            let line = lines.expect()?;
            let mut words = line.words();
            let tag = words.next("an element")?;
            let nodes = words.rest("a node")?;
            content.elements.push(RawElement { line: line.number, tag, shape, groups: groups.clone(), nodes });
        }
    }
    Ok(())
}

/// The lines of a file.
struct Lines<'a> {
    lines: Vec<&'a str>,
    next: usize,
}

/// One line and its number, from 1.
struct Line<'a> {
    text: &'a str,
    number: usize,
}

impl<'a> Lines<'a> {
    fn advance(&mut self) -> Option<Line<'a>> {
        let text = *self.lines.get(self.next)?;
        self.next += 1;
        Some(Line { text, number: self.next })
    }

    fn expect(&mut self) -> Result<Line<'a>, GmshError> {
        let last = self.lines.len().max(1);
        let line = self.advance().ok_or_else(|| GmshError::new(last, "the file ends too early", SAVE_AGAIN))?;
        if line.text.starts_with('$') {
            return Err(line.error("the section ends too early", SAVE_AGAIN));
        }
        Ok(line)
    }

    /// First number of the next line.
    fn count(&mut self) -> Result<usize, GmshError> {
        self.expect()?.words().next("a count")
    }

    /// The end of a section that has been read: its first line says how much there is of it.
    fn expect_end(&mut self, section: &str) -> Result<(), GmshError> {
        let end = format!("$End{section}");
        while let Some(line) = self.advance() {
            let text = line.text.trim();
            if text == end {
                return Ok(());
            }
            if !text.is_empty() {
                let problem =
                    format!("section ${section} goes on after as many entries as it announces: '{}'", shorten(text));
                return Err(
                    line.error(problem, format!("correct the numbers of entries in ${section}, or {SAVE_AGAIN}"))
                );
            }
        }
        Err(GmshError::new(self.next, format!("section ${section} has no {end}"), SAVE_AGAIN))
    }

    fn skip_to_end(&mut self, section: &str) -> Result<(), GmshError> {
        let end = format!("$End{section}");
        let start = self.next;
        while let Some(line) = self.advance() {
            if line.text.trim() == end {
                return Ok(());
            }
        }
        Err(GmshError::new(start, format!("section ${section} has no {end}"), SAVE_AGAIN))
    }
}

impl<'a> Line<'a> {
    fn words(&self) -> Words<'a> {
        Words { words: self.text.split_ascii_whitespace(), number: self.number }
    }

    fn error(&self, problem: impl Into<String>, remedy: impl Into<String>) -> GmshError {
        GmshError::new(self.number, problem, remedy)
    }
}

/// The words of a line.
struct Words<'a> {
    words: std::str::SplitAsciiWhitespace<'a>,
    number: usize,
}

impl Words<'_> {
    fn next<T: FromStr>(&mut self, what: &str) -> Result<T, GmshError> {
        let Some(word) = self.words.next() else {
            return Err(GmshError::new(self.number, format!("{what} is missing"), SAVE_AGAIN));
        };
        self.value(word, what)
    }

    fn rest<T: FromStr>(mut self, what: &str) -> Result<Vec<T>, GmshError> {
        let mut values = Vec::new();
        while let Some(word) = self.words.next() {
            values.push(self.value(word, what)?);
        }
        Ok(values)
    }

    fn value<T: FromStr>(&self, word: &str, what: &str) -> Result<T, GmshError> {
        let problem = || format!("'{}' is not {what}", shorten(word));
        word.parse().map_err(|_| GmshError::new(self.number, problem(), SAVE_AGAIN))
    }
}

fn shorten(text: &str) -> String {
    text.chars().take(40).collect()
}
