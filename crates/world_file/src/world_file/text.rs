//! RON text of a world file, laid out by width, with comments.

use ron::extensions::Extensions;

use super::world::WorldFile;
use crate::ron_file::ValuePath;

/// Greatest width of a line. A group of values that is wider has a line per value.
const WIDTH: usize = 100;
const INDENT: usize = 4;

/// Comment of a written world: lines above the value that they explain.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TextComment {
    /// Path of the value, such as `agents[1].drive`. [`ValuePath::top`] is the heading.
    pub at: ValuePath,
    /// Lines of the comment without `//`.
    pub text: String,
}

impl TextComment {
    /// Returns the lines above the text of a world.
    pub fn heading(text: impl Into<String>) -> TextComment {
        TextComment::new(ValuePath::top(), text)
    }

    /// Returns the lines above a value.
    pub fn new(at: ValuePath, text: impl Into<String>) -> TextComment {
        TextComment {
            at,
            text: text.into(),
        }
    }
}

/// World with the comments of its text, as a program writes it for readers.
///
/// ```
/// use brakecheck_files::ron_file::ValuePath;
/// use brakecheck_world_file::world_file::{self, CommentedWorld, TextComment};
///
/// # let text = brakecheck_worlds::WORLDS[0].1;
/// let world = world_file::parse("acc.ron", text)?;
/// let comments = vec![
///     TextComment::heading("Written by a program."),
///     TextComment::new(ValuePath::top().to("clock"), "10 s suffice."),
/// ];
/// let commented = CommentedWorld { world, comments };
/// let text = commented.text().expect("a text");
/// assert!(text.starts_with("// Written by a program.\nScenario(\n"));
/// assert!(text.contains("\n    // 10 s suffice.\n    clock: ("));
/// assert_eq!(world_file::parse("acc.ron", &text)?, commented.world);
/// # Ok::<(), brakecheck_files::ron_file::ScenarioError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct CommentedWorld {
    /// Value of the world.
    pub world: WorldFile,
    /// Comments in any order. Several ones of a value appear in theirs.
    pub comments: Vec<TextComment>,
}

impl CommentedWorld {
    /// Returns the RON text, which reads as an equal value.
    ///
    /// # Errors
    ///
    /// The path of a comment leads to no value of the text, such as a field with its default.
    pub fn text(&self) -> Result<String, ron::Error> {
        written(&self.world, &self.comments)
    }
}

/// Returns the RON text of a world, which reads as an equal value.
///
/// Fields with their defaults are left out, and the others have the order of the shapes.
///
/// # Errors
///
/// Values of world files are always written. The error is that of the writer.
pub fn text(world: &WorldFile) -> Result<String, ron::Error> {
    written(world, &[])
}

fn written(world: &WorldFile, comments: &[TextComment]) -> Result<String, ron::Error> {
    // As people write world files, without `Some` and without double brackets.
    let options = ron::Options::default()
        .with_default_extension(Extensions::IMPLICIT_SOME | Extensions::UNWRAP_VARIANT_NEWTYPES);
    // RON's own layout breaks lines by depth instead of width, and it has no comments, so
    // the lines are laid out here.
    let compact = options.to_string(world)?;
    let mut reader = CompactText {
        rest: &compact,
        comments,
        found: Vec::new(),
    };
    let top = ValuePath::top();
    let item = TextItem {
        comments: reader.comments_at(&top),
        name: String::new(),
        value: reader.node(&top),
    };
    // A comment that no line shows would be lost without a word.
    if let Some(lost) = comments.iter().find(|it| !reader.found.contains(&it.at)) {
        let what = format!("the text has no value at `{}` for a comment", lost.at);
        return Err(ron::Error::Message(what));
    }
    let mut text = String::new();
    item.write(0, "\n", &mut text);
    Ok(text)
}

/// Value of a text: a word, or a group of values with a name before its brackets.
struct TextNode {
    word: String,
    /// Brackets with the values between them. `None` is a word alone.
    group: Option<TextGroup>,
}

struct TextGroup {
    open: char,
    close: char,
    items: Vec<TextItem>,
}

/// Value in a group, with its name as it is written and the comments above it.
struct TextItem {
    comments: Vec<String>,
    /// `name: `, empty in a list.
    name: String,
    value: TextNode,
}

/// Reader of the RON writer's own text, which has no blanks, comments or raw strings.
struct CompactText<'a> {
    rest: &'a str,
    comments: &'a [TextComment],
    /// Paths of comments whose values were read.
    found: Vec<ValuePath>,
}

impl CompactText<'_> {
    fn comments_at(&mut self, path: &ValuePath) -> Vec<String> {
        let here = self.comments.iter().filter(|it| it.at == *path);
        let texts: Vec<String> = here.map(|it| it.text.clone()).collect();
        if !texts.is_empty() {
            self.found.push(path.clone());
        }
        texts
    }

    fn node(&mut self, path: &ValuePath) -> TextNode {
        let word = self.word();
        let close = match self.rest.chars().next() {
            Some('(') => ')',
            Some('[') => ']',
            Some('{') => '}',
            _ => return TextNode { word, group: None },
        };
        let open = self.bracket();
        let mut items = Vec::new();
        // Invariant: the writer closes every bracket. The end of the text ends all groups.
        while !self.rest.is_empty() && !self.rest.starts_with(close) {
            let found = self.found.len();
            let item = self.item(path, items.len());
            // A field reads as `None` where it is missing, too.
            if open == '(' && item.is_missing() {
                // Its comments have no line to stand above, and must not vanish silently.
                self.found.truncate(found);
            } else {
                items.push(item);
            }
            // The writer puts a comma between values, and none behind the last one.
            self.rest = self.rest.strip_prefix(',').unwrap_or(self.rest);
        }
        self.bracket();
        let group = Some(TextGroup { open, close, items });
        TextNode { word, group }
    }

    fn item(&mut self, group: &ValuePath, index: usize) -> TextItem {
        let before = self.rest;
        let name = self.word();
        if let Some(rest) = self.rest.strip_prefix(':') {
            self.rest = rest;
            // Keys of maps are strings with quotes and escapes, unlike fields of structs.
            let key: String = if name.starts_with('"') {
                ron::from_str(&name).unwrap_or_else(|_| name.clone())
            } else {
                name.clone()
            };
            let path = group.to(&key);
            return TextItem {
                comments: self.comments_at(&path),
                value: self.node(&path),
                name: name + ": ",
            };
        }
        // Without a colon, the word belongs to the value.
        self.rest = before;
        let path = group.at(index);
        TextItem {
            comments: self.comments_at(&path),
            value: self.node(&path),
            name: String::new(),
        }
    }

    /// Reads a bracket, a blank at the end of the text.
    fn bracket(&mut self) -> char {
        let mut chars = self.rest.chars();
        let first = chars.next().unwrap_or(' ');
        self.rest = chars.as_str();
        first
    }

    /// Reads a string, a number or a name, empty before a bracket.
    fn word(&mut self) -> String {
        let mut is_escaped = false;
        let mut is_string = false;
        let end = self.rest.find(|c: char| {
            // A bracket inside a string ends nothing.
            let ends = !is_string && "()[]{},:".contains(c);
            is_string ^= c == '"' && !is_escaped;
            is_escaped = c == '\\' && !is_escaped;
            ends
        });
        let (word, rest) = self.rest.split_at(end.unwrap_or(self.rest.len()));
        self.rest = rest;
        word.to_owned()
    }
}

impl TextItem {
    fn is_missing(&self) -> bool {
        // A text keeps its quotes as a word, so "None" in quotes is a value.
        !self.name.is_empty() && self.value.word == "None"
    }

    /// Writes the item from the begin of a line on, with `end` behind it.
    fn write(&self, indent: usize, end: &str, text: &mut String) {
        let margin = " ".repeat(indent);
        for line in self.comments.iter().flat_map(|it| it.lines()) {
            // A control character could end the comment or act on a terminal.
            let shown = line.replace(char::is_control, "_");
            *text += format!("{margin}// {shown}").trim_end();
            text.push('\n');
        }
        *text += &margin;
        *text += &self.name;
        // A comma follows on the same line.
        let used = indent + self.name.chars().count() + 1;
        self.value.write(indent, used, text);
        *text += end;
    }

    fn line(&self) -> String {
        format!("{}{}", self.name, self.value.line())
    }
}

impl TextNode {
    fn items(&self) -> &[TextItem] {
        self.group.as_ref().map_or(&[], |it| &it.items)
    }

    fn is_commented(&self) -> bool {
        let is = |it: &TextItem| !it.comments.is_empty() || it.value.is_commented();
        self.items().iter().any(is)
    }

    fn line(&self) -> String {
        let Some(TextGroup { open, close, items }) = &self.group else {
            return self.word.clone();
        };
        let items: Vec<String> = items.iter().map(TextItem::line).collect();
        let inner = items.join(", ");
        match open {
            '{' if !inner.is_empty() => format!("{}{{ {inner} }}", self.word),
            _ => format!("{}{open}{inner}{close}", self.word),
        }
    }

    /// Writes the value in the rest of a line of which `used` columns are taken, or with a
    /// line per value if it is too wide.
    fn write(&self, indent: usize, used: usize, text: &mut String) {
        let line = self.line();
        // A comment needs a line of its own above its value, however short that is.
        let fits = used + line.chars().count() <= WIDTH && !self.is_commented();
        // An empty group has no values to put on lines, so it stays whole.
        let group = self.group.as_ref().filter(|it| !it.items.is_empty());
        let Some(TextGroup { open, close, items }) = group.filter(|_| !fits) else {
            *text += &line;
            return;
        };
        *text += &format!("{}{open}\n", self.word);
        let inner = indent + INDENT;
        let is_plain = |it: &TextItem| it.value.group.is_none() && it.comments.is_empty();
        // A line for each number of a long list would hide the rest of the world.
        if items.iter().all(|it| is_plain(it) && it.name.is_empty()) {
            write_filled(items, inner, text);
        } else {
            for item in items {
                item.write(inner, ",\n", text);
            }
        }
        *text += &" ".repeat(indent);
        text.push(*close);
    }
}

/// Writes words one after another, as many in a line as fit.
fn write_filled(words: &[TextItem], indent: usize, text: &mut String) {
    let mut used = 0;
    for item in words {
        // Only values without names and comments get here, so the word is everything.
        let word = &item.value.word;
        // A comma and a blank follow each word.
        let width = word.chars().count() + 2;
        if used > 0 && used + width <= WIDTH {
            text.push(' ');
        } else {
            if used > 0 {
                text.push('\n');
            }
            *text += &" ".repeat(indent);
            used = indent;
        }
        *text += word;
        text.push(',');
        used += width;
    }
    text.push('\n');
}
