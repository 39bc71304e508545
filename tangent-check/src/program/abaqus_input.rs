//! An input file of Abaqus: the user materials with their internal variables, and the initial values.

use std::path::Path;

/// A user material.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Material {
    pub name: String,
    pub properties: Vec<f64>,
    /// The number of internal variables (*Depvar).
    pub variables: usize,
}

/// The user materials of an input file.
#[derive(Debug, Default)]
pub(super) struct Input {
    file: String,
    materials: Vec<Material>,
    /// The initial internal variables of the first set.
    pub state: Vec<f64>,
    /// The initial temperature of the first set.
    pub temperature: Option<f64>,
}

impl Input {
    /// The user material with this name, or the only one.
    ///
    /// # Errors
    /// None or several; the error lists their names.
    pub(super) fn material(&self, name: Option<&str>) -> Result<&Material, String> {
        let fits = |material: &&Material| name.is_none_or(|name| material.name.eq_ignore_ascii_case(name));
        match self.materials.iter().filter(fits).collect::<Vec<_>>().as_slice() {
            [material] => Ok(material),
            _ if self.materials.is_empty() => Err(format!(
                "{}: there is no *User Material. Give the file that has it, or the values by --properties and --state.",
                self.file
            )),
            found => {
                let names: Vec<&str> = self.materials.iter().map(|material| material.name.as_str()).collect();
                let (count, names) = (found.len(), names.join(", "));
                Err(format!("{}: {count} user materials fit. Choose one with --name; there are: {names}.", self.file))
            }
        }
    }
}

/// A keyword with its parameters and its data lines, which have their line numbers.
#[derive(Default)]
struct Block {
    file: String,
    /// In capitals, without blanks.
    keyword: String,
    parameters: Vec<(String, String)>,
    data: Vec<(usize, String)>,
}

impl Block {
    /// The value of a parameter.
    fn parameter(&self, name: &str) -> Option<&str> {
        self.parameters.iter().find(|(known, _)| known == name).map(|(_, value)| value.as_str())
    }

    /// Puts values in the places of symbols such as `<E>`.
    fn insert(&mut self, symbols: &[(String, String)]) {
        for (_, text) in self.data.iter_mut().filter(|(_, text)| text.contains('<')) {
            *text = text.to_uppercase();
            for (name, value) in symbols {
                *text = text.replace(&format!("<{name}>"), value);
            }
        }
    }

    /// The numbers of all data lines; `labels` fields stand before them.
    fn numbers(&self, labels: usize) -> Result<Vec<f64>, String> {
        let fields = self.data.iter().flat_map(|(line, text)| {
            // A comma at the end of a line separates nothing.
            text.trim().trim_end_matches(',').split(',').map(move |field| (*line, field.trim()))
        });
        let number = |(line, field): (usize, &str)| {
            let value = if field.is_empty() { Ok(0.0) } else { field.replace(['d', 'D'], "e").parse::<f64>() };
            value.map_err(|_| format!("line {line}: `{field}` is not a number."))
        };
        fields.skip(labels).map(number).collect()
    }
}

/// Reads an input file.
///
/// # Errors
/// A sentence: which line, what is allowed.
pub(super) fn read(path: &Path) -> Result<Input, String> {
    let mut input = Input { file: path.display().to_string(), ..Input::default() };
    let mut name = String::new();
    let mut variables = 0;
    let mut all = Vec::new();
    collect(path, &mut all, 0)?;
    let mut symbols = Vec::new();
    for mut block in all {
        block.insert(&symbols);
        let says = |what: String| format!("{}: *{}, {what}", block.file, block.keyword);
        match block.keyword.as_str() {
            "MATERIAL" => (name, variables) = (block.parameter("NAME").unwrap_or_default().to_owned(), 0),
            // Parameters that are computed stay unknown: their use is an error that shows them.
            "PARAMETER" => symbols.extend(block.data.iter().flat_map(|(_, text)| parameters(text))),
            "USERMATERIAL" => {
                let properties = properties(&block).map_err(says)?;
                input.materials.push(Material { name: name.clone(), properties, variables });
            }
            "DEPVAR" => {
                // *Depvar may stand before or behind *User Material.
                let first = block.data.first().map_or("", |(_, text)| text.split(',').next().unwrap_or("").trim());
                let count = first.parse().map_err(|_| says(format!("`{first}` is not a whole number.")))?;
                variables = count;
                let last = input.materials.last_mut().filter(|material| material.name == name);
                last.into_iter().for_each(|material| material.variables = count);
            }
            "INITIALCONDITIONS" => initial(&block, &mut input).map_err(says)?,
            _ => {}
        }
    }
    Ok(input)
}

/// The constants of a user material.
fn properties(block: &Block) -> Result<Vec<f64>, String> {
    let mut numbers = block.numbers(0)?;
    let wanted = block.parameter("CONSTANTS").unwrap_or("0");
    let count: usize = wanted.parse().map_err(|_| format!("CONSTANTS={wanted} is not a whole number."))?;
    if numbers.len() < count {
        return Err(format!("CONSTANTS={count}, but {} numbers follow.", numbers.len()));
    }
    numbers.truncate(count);
    Ok(numbers)
}

/// Takes the initial values of the first set, which stand behind its label.
fn initial(block: &Block, input: &mut Input) -> Result<(), String> {
    let kind = block.parameter("TYPE").unwrap_or_default().to_uppercase();
    let first_lines = || {
        // The lines of a second set begin with a label, which is no number or, in the first column, another element.
        let labelled = |text: &str| text.split(',').next().is_some_and(|field| field.trim().parse::<f64>().is_err());
        let end =
            block.data.iter().skip(1).position(|(_, text)| labelled(text)).map_or(block.data.len(), |end| end + 1);
        Block { data: block.data[..end].to_vec(), ..Block::default() }
    };
    match kind.as_str() {
        "SOLUTION" if block.parameter("USER").is_none() && input.state.is_empty() => {
            input.state = first_lines().numbers(1)?;
        }
        "TEMPERATURE" if input.temperature.is_none() => {
            input.temperature = first_lines().numbers(1)?.first().copied();
        }
        _ => {}
    }
    Ok(())
}

/// So deeply may files include others.
const DEEPEST: usize = 10;

/// The blocks of a file and of those that it includes.
fn collect(path: &Path, all: &mut Vec<Block>, depth: usize) -> Result<(), String> {
    let text = std::fs::read(path).map_err(|error| format!("{}: {error}.", path.display()))?;
    for mut block in blocks(&String::from_utf8_lossy(&text)) {
        if block.keyword == "INCLUDE" {
            let file = block.parameter("INPUT").or(block.parameter("FILE")).unwrap_or_default();
            let included = path.with_file_name(file);
            if depth == DEEPEST {
                return Err(format!("{}: files include each other more than {DEEPEST} deep.", path.display()));
            }
            // Files of loads and meshes may be missing; they say nothing about the law.
            if included.is_file() {
                collect(&included, all, depth + 1)?;
            }
            continue;
        }
        block.file = path.display().to_string();
        all.push(block);
    }
    Ok(())
}

/// The blocks of a text. Comments are left out; a keyword line that ends with a comma goes on in the next one.
fn blocks(text: &str) -> Vec<Block> {
    let mut blocks: Vec<Block> = Vec::new();
    let mut continued = false;
    for (index, line) in text.lines().enumerate().filter(|(_, line)| !line.starts_with("**") && !line.trim().is_empty())
    {
        let keyword = line.starts_with('*');
        match blocks.last_mut() {
            Some(block) if continued && !keyword => block.parameters.extend(parameters(line)),
            Some(block) if !keyword => {
                block.data.push((index + 1, line.to_owned()));
                continue;
            }
            _ if !keyword => continue,
            _ => {
                let (name, rest) = line[1..].split_once(',').unwrap_or((&line[1..], ""));
                let keyword = name.split_whitespace().collect::<String>().to_uppercase();
                blocks.push(Block { keyword, parameters: parameters(rest), ..Block::default() });
            }
        }
        continued = line.trim_end().ends_with(',');
    }
    blocks
}

/// `NAME=VALUE, …`, the names in capitals.
fn parameters(text: &str) -> Vec<(String, String)> {
    let parts = text.split(',').filter(|part| !part.trim().is_empty());
    let pair = |part: &str| {
        let (name, value) = part.split_once('=').unwrap_or((part, ""));
        (name.trim().to_uppercase(), value.trim().trim_matches('"').to_owned())
    };
    parts.map(pair).collect()
}
