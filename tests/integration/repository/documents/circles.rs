//! Circles of files: files of one crate that reach each other over the paths in their sources.
//!
//! A path counts for the file of the module that it names; what a module passes on (`pub use`) counts for that module. A module
//! that passes on a name of its child depends on the child only if it uses the name itself.

use super::map::{is_product, largest_circle, members};
use super::text::{files, no_faults, normalised, read};
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

/// Most files of one crate that may reach each other: what can be read at once.
const LARGEST: usize = 4;

/// Names of modules from the root of the crate on.
type Module = Vec<String>;

/// Words and signs of a source; comments, literals, what only tests compile, and folders of visibilities are left out.
fn tokens(text: &str) -> Vec<String> {
    let letters: Vec<char> = text.chars().collect();
    let (mut found, mut at) = (Vec::<String>::new(), 0);
    let from = |at: usize, sign: &str| letters[at..].iter().copied().take(sign.len()).eq(sign.chars());
    while at < letters.len() {
        let begin = at;
        if letters[at].is_alphanumeric() || letters[at] == '_' {
            while letters.get(at).is_some_and(|letter| letter.is_alphanumeric() || *letter == '_') {
                at += 1;
            }
            found.push(letters[begin..at].iter().collect());
        } else if from(at, "//") {
            while letters.get(at).is_some_and(|letter| *letter != '\n') {
                at += 1;
            }
        } else if letters[at] == '"' {
            let hashes = found.iter().rev().take_while(|sign| *sign == "#").count();
            let is_raw = found.iter().rev().nth(hashes).is_some_and(|word| word == "r" || word == "br");
            let end = if is_raw { format!("\"{}", "#".repeat(hashes)) } else { "\"".to_owned() };
            at += 1;
            while at < letters.len() && !from(at, &end) {
                at += if letters[at] == '\\' && !is_raw { 2 } else { 1 };
            }
            at += end.len();
        } else if letters[at] == '\'' && (letters.get(at + 2) == Some(&'\'') || letters.get(at + 1) == Some(&'\\')) {
            at += 2;
            while letters.get(at).is_some_and(|letter| *letter != '\'') {
                at += 1;
            }
            at += 1;
        } else {
            at += if from(at, "::") { 2 } else { 1 };
            found.push(letters[begin..at].iter().collect());
        }
        if found.last().is_some_and(|sign| sign.trim().is_empty()) {
            found.pop();
        }
    }
    without(&without(&found, &["#", "[", "cfg", "(", "test", ")", "]"], end_of_item), &["(", "in"], |signs| {
        signs.iter().position(|sign| sign == ")").map_or(0, |end| end + 1)
    })
}

/// The signs without each place that begins with `lead`, up to the end that `end` finds behind it.
fn without(signs: &[String], lead: &[&str], end: fn(&[String]) -> usize) -> Vec<String> {
    let (mut kept, mut at) = (Vec::new(), 0);
    while at < signs.len() {
        if signs[at..].iter().take(lead.len()).eq(lead) {
            at += lead.len();
            at += end(&signs[at..]);
        } else {
            kept.push(signs[at].clone());
            at += 1;
        }
    }
    kept
}

/// Number of signs up to the end of the item that they begin with: its `;`, or the brace that closes it.
fn end_of_item(signs: &[String]) -> usize {
    let mut depth = 0;
    for (at, sign) in signs.iter().enumerate() {
        match sign.as_str() {
            "{" | "(" | "[" => depth += 1,
            "}" | ")" | "]" => depth -= 1,
            _ => {}
        }
        let closes = sign == "}" && signs.get(at + 1).is_none_or(|next| next != ";");
        if depth == 0 && (sign == ";" || closes) {
            return at + 1;
        }
    }
    signs.len()
}

/// Paths of a tree such as `a::{b, c::d}`, and the place behind it.
fn tree(signs: &[String], mut at: usize) -> (Vec<Module>, usize) {
    let mut lead = Module::new();
    while let Some(sign) = signs.get(at) {
        if sign == "{" {
            let mut found = Vec::new();
            at += 1;
            while signs.get(at).is_some_and(|sign| sign != "}") {
                if signs[at] == "," {
                    at += 1;
                    continue;
                }
                let (inner, behind) = tree(signs, at);
                found.extend(inner.into_iter().map(|path| [lead.clone(), path].concat()));
                at = behind.max(at + 1);
            }
            return (found, at + 1);
        }
        if sign != "*" && !sign.chars().all(|letter| letter.is_alphanumeric() || letter == '_') {
            break;
        }
        lead.push(sign.clone());
        at += 1;
        if signs.get(at).is_some_and(|sign| sign == "as") {
            at += 2;
        }
        if signs.get(at).is_none_or(|sign| sign != "::") {
            break;
        }
        at += 1;
    }
    (vec![lead], at)
}

/// Paths from the root of the crate that the source of `module` names; `pub use` of children only where the name is used.
fn named(signs: &[String], module: &Module) -> Vec<Module> {
    let children = signs.windows(3).filter(|three| three[0] == "mod" && three[2] == ";");
    let children: BTreeSet<&str> = children.map(|three| three[1].as_str()).collect();
    let (mut found, mut passed_on, mut used) = (Vec::new(), Vec::new(), BTreeSet::new());
    let (mut inner, mut depth, mut at) = (Vec::<(&str, usize)>::new(), 0, 0);
    while at < signs.len() {
        let sign = signs[at].as_str();
        let before = |count: usize| at.checked_sub(count).map_or("", |place| signs[place].as_str());
        match sign {
            "{" => {
                depth += 1;
                if before(2) == "mod" {
                    inner.push((before(1), depth));
                }
            }
            "}" => {
                inner.retain(|(_, of)| *of != depth);
                depth -= 1;
            }
            _ => {}
        }
        let begins = ["crate", "super", "self"].contains(&sign) || children.contains(sign);
        if !begins || before(1) == "::" || signs.get(at + 1).is_none_or(|next| next != "::") {
            used.insert(sign);
            at += 1;
            continue;
        }
        let here = [module.clone(), inner.iter().map(|(name, _)| (*name).to_owned()).collect()].concat();
        let is_passed_on = before(1) == "use" && [")", "pub"].contains(&before(2));
        let (paths, behind) = tree(signs, at);
        at = behind;
        for path in paths {
            let ups = path.iter().take_while(|name| *name == "super").count();
            let skipped = ups.max(usize::from(["crate", "self"].contains(&path[0].as_str())));
            let base = if path[0] == "crate" { &[] } else { &here[..here.len().saturating_sub(ups)] };
            let whole: Module = [base, &path[skipped..]].concat();
            if is_passed_on && whole.starts_with(module) { passed_on.push(whole) } else { found.push(whole) }
        }
    }
    passed_on.retain(|path| path.last().is_some_and(|name| used.contains(name.as_str())));
    found.extend(passed_on);
    found
}

/// Files of a crate, each with the other files that its source names.
fn arrows(member: &str, files: &[String]) -> BTreeMap<String, BTreeSet<String>> {
    let source = normalised(&PathBuf::from(member).join("src")) + "/";
    let inside = |file: &&String| is_product(file) && file.starts_with(&source);
    let has_library = files.contains(&format!("{source}lib.rs"));
    let mut modules = BTreeMap::new();
    for file in files.iter().filter(inside) {
        let path = file[source.len()..].trim_end_matches(".rs").trim_end_matches("/mod");
        match path {
            "main" if has_library => {}
            "lib" | "main" => _ = modules.insert(Module::new(), file),
            _ => _ = modules.insert(path.split('/').map(str::to_owned).collect(), file),
        }
    }
    let others = |module: &Module, file: &String| {
        let of = |path: &Module| (0..=path.len()).rev().find_map(|count| modules.get(&path[..count]).copied());
        let named = named(&tokens(&read(file)), module);
        named.iter().filter_map(of).filter(|other| *other != file).cloned().collect()
    };
    modules.iter().map(|(module, file)| ((*file).clone(), others(module, file))).collect()
}

#[test]
fn few_files_reach_each_other_in_a_circle() {
    let files = files();
    let mut faults = Vec::new();
    let mut counted = 0;
    for member in members() {
        let arrows = arrows(&member, &files);
        counted += arrows.values().map(BTreeSet::len).sum::<usize>();
        let circle = largest_circle(&arrows);
        if circle.len() > LARGEST {
            faults.push(format!("{member}: more than {LARGEST} files reach each other: {circle:?}"));
        }
    }
    assert!(counted > 2000, "only {counted} paths between files were found");
    no_faults(&faults);
}

#[test]
fn paths_are_found_in_sources() {
    let text = r##"
        mod child;
        #[cfg(test)]
        mod tests { use super::not_this; }
        pub(in crate::not_this) use child::{Used, PassedOn};
        // crate::not_this
        const TEXT: &str = r#"{ "crate::not_this" "#;
        use super::{a::B, c};
        fn f(brace: char) -> Used { assert_eq!(brace, '{'); crate::d::<T>(self::e) }
        mod inner { use super::super::g as h; }
    "##;
    let found = named(&tokens(text), &vec!["top".to_owned(), "middle".to_owned()]);
    let expected = ["top::a::B", "top::c", "d", "top::middle::e", "top::g", "top::middle::child::Used"];
    assert_eq!(found.iter().map(|path| path.join("::")).collect::<Vec<_>>(), expected);
}
