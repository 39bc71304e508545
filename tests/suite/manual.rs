//! The manual: links are valid, named files exist, the book lists its pages, and its page of keys matches the schema.

use crate::support::Failure;
use bfree::scene;
use bfree::scene::accuracy::levels;
use pulldown_cmark::{BrokenLink, CodeBlockKind, Event, LinkType, Options, Parser, Tag, TagEnd};
use serde_json::Value;
use std::collections::{BTreeSet, VecDeque};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Documents beside the book.
const DOCUMENTS: [&str; 7] = [
    "README.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    "tests/reference/README.md",
    "verification/FULL.md",
    "verification/RESULTS.md",
    "verification/TRADEOFF.md",
];

/// Folders whose files are named in running text by their whole path.
const FOLDERS: [&str; 10] =
    [".ci", "benches", "docs", "examples", "python", "scenes", "schemas", "src", "tests", "verification"];

/// A file of the repository.
pub fn in_repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// The contents of a document that the tests check.
#[derive(Default)]
pub struct Page {
    /// Targets of links and pictures.
    links: Vec<String>,
    /// Links to undefined labels.
    undefined: Vec<String>,
    /// Anchors of the document.
    anchors: BTreeSet<String>,
    /// Code in running text.
    code: Vec<String>,
    /// Fenced blocks: the word behind the fence, and the text.
    pub blocks: Vec<(String, String)>,
}

impl Page {
    pub fn read(path: &Path) -> Result<Self, Failure> {
        let text = std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
        let (mut page, mut undefined) = (Self::default(), Vec::new());
        let mut note = |link: BrokenLink<'_>| {
            if matches!(link.link_type, LinkType::Reference | LinkType::ReferenceUnknown) {
                undefined.push(link.reference.to_string());
            }
            None
        };
        let (mut heading, mut block) = (None::<String>, None::<(String, String)>);
        for event in Parser::new_with_broken_link_callback(&text, Options::ENABLE_TABLES, Some(&mut note)) {
            match event {
                Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => {
                    page.links.push(dest_url.to_string());
                }
                Event::Start(Tag::Heading { .. }) => heading = Some(String::new()),
                Event::End(TagEnd::Heading(_)) => {
                    page.anchors.extend(heading.take().map(|heading| anchor(&heading)));
                }
                Event::Start(Tag::CodeBlock(CodeBlockKind::Fenced(info))) => {
                    block = Some((info.to_string(), String::new()));
                }
                Event::End(TagEnd::CodeBlock) => page.blocks.extend(block.take()),
                Event::Text(text) => {
                    let block = block.as_mut().map(|(_, block)| block);
                    heading.as_mut().or(block).into_iter().for_each(|part| part.push_str(&text));
                }
                Event::Code(code) => {
                    heading.iter_mut().for_each(|heading| heading.push_str(&code));
                    page.code.push(code.to_string());
                }
                _ => {}
            }
        }
        page.undefined = undefined;
        Ok(page)
    }
}

/// The anchor of a heading, as mdBook and the usual sites make it.
fn anchor(heading: &str) -> String {
    let kept = |c: char| match c {
        ' ' => Some('-'),
        c if c.is_alphanumeric() || c == '-' || c == '_' => Some(c.to_ascii_lowercase()),
        _ => None,
    };
    heading.chars().filter_map(kept).collect()
}

/// All pages of the book but its table of contents.
fn book() -> Result<Vec<PathBuf>, Failure> {
    let (mut pages, mut folders) = (Vec::new(), vec![in_repository("docs/src")]);
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder)? {
            let path = entry?.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "md") && !path.ends_with("SUMMARY.md") {
                pages.push(path);
            }
        }
    }
    pages.sort();
    Ok(pages)
}

#[test]
fn every_link_leads_somewhere() -> Result<(), Failure> {
    let (source, mut pages) = (in_repository("docs/src").canonicalize()?, book()?);
    pages.extend(DOCUMENTS.map(in_repository));
    pages.push(source.join("SUMMARY.md"));
    let (mut wrong, mut followed) = (Vec::new(), 0);
    for file in &pages {
        let (page, file) = (Page::read(file)?, file.canonicalize()?);
        let mut refuse = |link: &str, why: &str| wrong.push(format!("{}: {link}: {why}", file.display()));
        page.undefined.iter().for_each(|link| refuse(link, "no such label"));
        for link in page.links.iter().filter(|link| !link.contains("://")) {
            let (path, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target =
                if path.is_empty() { Ok(file.clone()) } else { file.with_file_name("").join(path).canonicalize() };
            followed += 1;
            match target {
                Err(error) => refuse(link, &error.to_string()),
                // The book is a separate folder when it is built, so its links must not lead outside.
                Ok(target) if file.starts_with(&source) && !target.starts_with(&source) => {
                    refuse(link, "not in the book")
                }
                Ok(target) if !anchor.is_empty() && !Page::read(&target)?.anchors.contains(anchor) => {
                    refuse(link, "no such heading")
                }
                Ok(_) => {}
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(followed > 50, "{followed}");
    Ok(())
}

#[test]
fn files_that_are_named_are_there() -> Result<(), Failure> {
    let mut pages = book()?;
    pages.extend(["README.md", "CONTRIBUTING.md"].map(in_repository));
    let (mut wrong, mut found) = (Vec::new(), 0);
    for file in pages {
        let whole = |code: &String| {
            let in_folder = code.split_once('/').is_some_and(|(folder, _)| FOLDERS.contains(&folder));
            in_folder && !code.contains("NAME") && code.chars().all(|c| c.is_ascii_alphanumeric() || "./_-".contains(c))
        };
        for code in Page::read(&file)?.code.into_iter().filter(whole) {
            found += 1;
            if !in_repository(&code).exists() {
                wrong.push(format!("{}: `{code}`", file.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(found > 50, "{found}");
    Ok(())
}

#[test]
fn the_book_lists_all_its_pages() -> Result<(), Failure> {
    let source = in_repository("docs/src");
    let mut listed: Vec<PathBuf> =
        Page::read(&source.join("SUMMARY.md"))?.links.iter().map(|link| source.join(link)).collect();
    listed.sort();
    assert_eq!(listed, book()?);
    Ok(())
}

#[test]
fn the_page_of_keys_is_that_of_the_schema() -> Result<(), Failure> {
    let (path, asked) = (in_repository("docs/src/scenes.md"), keys());
    if std::env::var_os("BFREE_WRITE_SCHEMA").is_some() {
        std::fs::write(&path, &asked)?;
    }
    let stored = std::fs::read_to_string(&path)?;
    assert!(stored == asked, "renew it: BFREE_WRITE_SCHEMA=1 cargo test --release --test suite schema");
    Ok(())
}

/// The table of `accuracy`, row by row.
#[test]
fn the_manual_gives_the_levels_of_accuracy() -> Result<(), Failure> {
    let page = std::fs::read_to_string(in_repository("docs/src/choosing.md"))?;
    for level in levels() {
        let named = level.name.map_or_else(|| format!("{{\"error\": {}}}", level.error), |name| format!("{name:?}"));
        let percent = (level.error * 1e6).round() / 1e4;
        let error = if level.error.is_finite() { format!("{percent} %") } else { "none promised".into() };
        let row = format!("| `{named}` | {error} | {} | {} |\n", level.cells, level.courant);
        assert!(page.contains(&row), "not in the page: {row}");
    }
    Ok(())
}

/// The text above the index.
const ABOUT_SCENES: &str = "\
# Scenes

<!-- Written from the schema: BFREE_WRITE_SCHEMA=1 cargo test --release --test suite schema -->

A scene is one JSON file. This page lists every key, by topic. [The scene](#the-scene) has the keys of the file itself, and links to what they
take. The page is generated from the schema, `schemas/scene.schema.json`, which `bfree schema` prints too; `bfree new` writes it beside a
scene, so that editors complete and explain the keys.

Units are your own consistent set, such as m, kg, s or mm, t, s. Lists of numbers have one entry per dimension of the grid. Where
`accuracy` is given, `grid.spacing` and `time.step` may be left out.

`bfree check SCENE` validates a scene and says what it needs. On the command line `--set KEY.PATH=JSON` replaces a key:
`--set grid.spacing=0.25`, `--set bodies.0.density=2`.
";

/// The topics of the page, each with the types that it begins with. Types that these mention follow them, unless an earlier topic has them.
const TOPICS: [(&str, &[&str]); 9] = [
    ("The grid and its functions", &["GridBox", "Approximation", "Accuracy"]),
    ("Bodies", &["Body"]),
    ("Shapes", &["Shape"]),
    ("Laws", &["Material"]),
    (
        "Motions and loads",
        &["Boundary", "Prescribed", "InitialVelocity", "Gravity", "Traction", "Pressure", "Rayleigh"],
    ),
    ("Obstacles and contact between bodies", &["Obstacle", "Contact"]),
    ("Time and the transfer to particles", &["Time", "Transfer"]),
    ("The solver", &["Solver"]),
    ("Results", &["Output"]),
];

/// The page: an index, the scene, then every type, by topic.
fn keys() -> String {
    let schema = scene::schema().to_value();
    let met = TOPICS.iter().flat_map(|(_, types)| *types).map(|&name| name.to_owned()).collect();
    let mut writer = Writer { text: String::new(), met, next: VecDeque::new() };
    let mut index = format!("{ABOUT_SCENES}\n| topic | sections |\n|---|---|\n");
    writer.section("## The scene", &schema);
    for (topic, types) in TOPICS {
        // Writing to a string cannot fail.
        let _ = write!(writer.text, "\n## {topic}\n");
        writer.next.extend(types.iter().map(|&name| name.to_owned()));
        let mut sections = Vec::new();
        while let Some(name) = writer.next.pop_front() {
            let schema = &schema["$defs"][&name];
            assert!(schema.is_object(), "the schema has no type {name}: correct the topic {topic}");
            writer.section(&format!("### {name}"), schema);
            sections.push(link(&name));
        }
        let _ = writeln!(index, "| {} | {} |", link(topic), sections.join(", "));
    }
    index + &writer.text
}

/// A link to a heading of the page.
fn link(heading: &str) -> String {
    format!("[{heading}](#{})", anchor(heading))
}

struct Writer {
    text: String,
    met: BTreeSet<String>,
    next: VecDeque<String>,
}

impl Writer {
    fn section(&mut self, heading: &str, schema: &Value) {
        let _ = write!(self.text, "\n{heading}\n\n{}\n", about(schema));
        if let Some(variants) = schema["oneOf"].as_array() {
            self.text.push_str("\n| write | where | |\n|---|---|---|\n");
            for variant in variants {
                self.variant(variant);
            }
        } else if let Some(keys) = schema["properties"].as_object() {
            self.text.push_str("\n| key | value | |\n|---|---|---|\n");
            for key in keys.keys() {
                self.key(key, schema, key);
            }
        } else {
            let kind = self.kind(schema);
            let _ = writeln!(self.text, "\nA {kind}.");
        }
    }

    /// A variant is a word, or an object with one key.
    fn variant(&mut self, variant: &Value) {
        let key = variant["properties"].as_object().and_then(|keys| keys.iter().next());
        match (variant["const"].as_str(), key) {
            (Some(word), _) => self.row(&format!("`{}`", Value::from(word)), "", &about(variant)),
            (None, Some((key, value))) => {
                let parts = value["properties"].as_object();
                let kind = if parts.is_some() { String::new() } else { format!("… is {}", self.kind(value)) };
                self.row(&format!("`{{\"{key}\": …}}`"), &kind, &about(variant));
                for part in parts.into_iter().flat_map(|parts| parts.keys()) {
                    self.key(&format!("{key}.{part}"), value, part);
                }
            }
            (None, None) => {}
        }
    }

    /// The row of a key of an object, whose path is `name`.
    fn key(&mut self, name: &str, object: &Value, key: &str) {
        let required = object["required"].as_array().is_some_and(|keys| keys.contains(&key.into()));
        let must = if required { "**Required.** " } else { "" };
        let value = &object["properties"][key];
        let kind = self.kind(value);
        self.row(&format!("`{name}`"), &kind, &format!("{must}{}", about(value)));
    }

    fn row(&mut self, first: &str, second: &str, third: &str) {
        // A bar would end the table cell, in code too.
        let cell = |text: &str| text.replace('|', "\\|");
        let _ = writeln!(self.text, "| {} | {} | {} |", cell(first), cell(second), cell(third));
    }

    /// The allowed forms of a value. A type with a section of its own becomes a link, and its section is queued.
    fn kind(&mut self, schema: &Value) -> String {
        if let Some(name) = schema["$ref"].as_str().and_then(|name| name.strip_prefix("#/$defs/")) {
            if self.met.insert(name.to_owned()) {
                self.next.push_back(name.to_owned());
            }
            return link(name);
        }
        if let Some(any) = schema["anyOf"].as_array() {
            let kinds: Vec<String> = any.iter().filter(|one| one["type"] != "null").map(|one| self.kind(one)).collect();
            return kinds.join(" or ");
        }
        if let Some(parts) = schema["prefixItems"].as_array() {
            let parts: Vec<String> = parts.iter().map(|part| self.kind(part)).collect();
            return format!("pair: {}", parts.join(", "));
        }
        let name = schema["type"].as_str().or_else(|| schema["type"].as_array().and_then(|types| types[0].as_str()));
        match name {
            Some("array") => format!("list of {}", self.kind(&schema["items"])),
            Some("string") => "text".to_owned(),
            Some("boolean") => "true or false".to_owned(),
            Some(name) => name.to_owned(),
            None => String::new(),
        }
    }
}

fn about(schema: &Value) -> String {
    schema["description"].as_str().unwrap_or_default().split_whitespace().collect::<Vec<_>>().join(" ")
}
