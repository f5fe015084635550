//! Hover and completion at a place of a text.

use std::ops::Range;

use serde_json::Value;

use crate::items::{
    Completions, FORMULA_WORDS, Item, ItemKind, name_item, variant_item, word_item,
};
use crate::language::{KnownName, WorldLanguage};
use crate::names::{NameKind, declared};
use crate::outline::{Outline, RonGroup, RonToken};
use crate::shapes::{Shapes, VariantShape};

/// Units by the ends of names, the longer ends first.
const UNITS: [(&str, &str); 15] = [
    ("_rad_per_s", "rad/s"),
    ("_per_1000_km", "per 1,000 km"),
    ("_kg_m2", "kg·m²"),
    ("_per_s2", "1/s²"),
    ("_per_s", "1/s"),
    ("_per_m", "1/m"),
    ("_mps2", "m/s²"),
    ("_mps3", "m/s³"),
    ("_mps", "m/s"),
    ("_rad", "rad"),
    ("_hz", "Hz"),
    ("_kg", "kg"),
    ("_n", "N"),
    ("_m", "m"),
    ("_s", "s"),
];
/// Greatest number of completions, of which a person reads a few.
const MOST_ITEMS: usize = 500;

/// Place of a text, with the knowledge about its world.
pub struct Cursor<'a> {
    text: &'a str,
    at: usize,
    language: &'a dyn WorldLanguage,
    /// Names of the last version without a mistake.
    names: &'a [KnownName],
    outline: Outline,
    /// Shapes of the value and of the content of the group around it.
    value: Vec<&'a Value>,
    inside: Vec<&'a Value>,
}

/// Explanation of a part of the text.
#[derive(Debug, PartialEq, Eq)]
pub struct Explained {
    /// Markdown.
    pub markdown: String,
    /// Bytes that it explains.
    pub span: Range<usize>,
}

impl<'a> Cursor<'a> {
    /// Returns the cursor at a byte of a text. `None` if the text is nested too deeply.
    pub fn new(
        text: &'a str,
        at: usize,
        language: &'a dyn WorldLanguage,
        names: &'a [KnownName],
    ) -> Option<Cursor<'a>> {
        let outline = Outline::at(text, at)?;
        let shapes = Shapes::new(language.schema());
        // Once per request, because hover and completion both need them.
        let (value, inside) = shapes.along(text, &outline.groups);
        Some(Cursor {
            text,
            at,
            language,
            names,
            outline,
            value,
            inside,
        })
    }

    fn shapes(&self) -> Shapes<'a> {
        Shapes::new(self.language.schema())
    }

    /// Returns the explanation of the field, variant or name at the place.
    pub fn hover(&self) -> Option<Explained> {
        let (span, markdown) = match &self.outline.token {
            RonToken::Word(span) => (span.clone(), self.hover_of_word(span)),
            RonToken::Quoted(content) => {
                let span = name_around(self.text, content, self.at);
                let known = self.known(&self.text[span.clone()]);
                // A text such as a name of a road may equal that of a signal.
                match known.filter(|_| self.may_be_signal()) {
                    Some(name) => (span, Some(name_markdown(name))),
                    None => (content.clone(), self.hover_of_key()),
                }
            }
            RonToken::Blank | RonToken::Comment => return None,
        };
        markdown.map(|markdown| Explained { markdown, span })
    }

    fn hover_of_word(&self, span: &Range<usize>) -> Option<String> {
        let word = &self.text[span.clone()];
        let is_key = self.is_before_colon(span.end);
        // Keys of maps are names of the user, for which the schema has no
        // fields.
        if is_key && self.outline.inner().is_some_and(|it| it.bracket == '(') {
            return self.field_markdown(word);
        }
        let variants = self.shapes().variants(&self.value);
        let variant = variants.into_iter().find(|it| it.name == word);
        variant
            .map(|variant| variant_markdown(&variant))
            // A number or an unknown word is explained by its field.
            .or_else(|| self.hover_of_key())
    }

    /// Explanation of the field whose value is at the place.
    fn hover_of_key(&self) -> Option<String> {
        let with_key = |group: &&RonGroup| group.bracket == '(' && group.key.is_some();
        let groups = &self.outline.groups;
        let depth = groups.iter().rposition(|group| with_key(&group))?;
        // Again along a shorter path, since lists and maps lie between the
        // field and the place.
        let (_, inside) = self.shapes().along(self.text, &groups[..=depth]);
        let key = &self.text[groups[depth].key.clone()?];
        let node = self.shapes().field(&inside, key)?;
        Some(self.markdown(key, node))
    }

    fn field_markdown(&self, name: &str) -> Option<String> {
        let node = self.shapes().field(&self.inside, name)?;
        Some(self.markdown(name, node))
    }

    fn markdown(&self, name: &str, node: &'a Value) -> String {
        let detail = self.detail(name, node);
        let about = self.shapes().about(node).unwrap_or_default();
        format!("`{name}`: {detail}\n\n{about}")
            .trim_end()
            .to_owned()
    }

    /// Type, unit and default of a field.
    fn detail(&self, name: &str, node: &'a Value) -> String {
        let mut detail = self.shapes().type_words(node);
        // The first match is the longest, by the order of the table.
        let unit = UNITS.iter().find(|(end, _)| name.ends_with(end));
        if let Some((_, unit)) = unit {
            detail += &format!(" in {unit}");
        }
        let default = node.get("default").and_then(short_ron);
        if let Some(default) = default {
            detail += &format!(", default `{default}`");
        }
        detail
    }

    fn is_before_colon(&self, end: usize) -> bool {
        self.text[end..].trim_start().starts_with(':')
    }

    /// Name of the field around the place, whose lists and maps count as it.
    fn field_name(&self) -> Option<&str> {
        let mut groups = self.outline.groups.iter().rev();
        let named = groups.find(|group| group.bracket == '(' && group.key.is_some())?;
        named.key.clone().map(|key| &self.text[key])
    }

    fn may_be_signal(&self) -> bool {
        let is_key = self.outline.inner().is_some_and(|it| it.bracket == '{');
        // Formulas may be values of a map, whose field is further out.
        let kind = self.field_name().and_then(NameKind::of_field);
        is_key || kind == Some(NameKind::Signal)
    }

    fn known(&self, name: &str) -> Option<&KnownName> {
        self.names.iter().find(|known| known.name == name)
    }

    /// Returns what can be written at the place.
    pub fn completions(&self) -> Completions {
        let (span, mut items) = match &self.outline.token {
            RonToken::Comment => (self.at..self.at, Vec::new()),
            RonToken::Quoted(content) => {
                let span = name_around(self.text, content, self.at);
                (span, self.names_here())
            }
            RonToken::Word(span) => (span.clone(), self.fields_and_variants(span.end)),
            RonToken::Blank => (self.at..self.at, self.fields_and_variants(self.at)),
        };
        // At the end, so that the order of the lists decides what is left out.
        items.truncate(MOST_ITEMS);
        Completions { span, items }
    }

    fn fields_and_variants(&self, end: usize) -> Vec<Item> {
        let is_key = self.is_before_colon(end);
        let mut items = Vec::new();
        let inner = self.outline.inner();
        // After a key and its colon a value follows, and no field.
        if let Some(group) = inner.filter(|it| it.bracket == '(' && it.key.is_none()) {
            items.extend(self.missing_fields(group, is_key));
        }
        // A name before a colon is a field, not a variant.
        if !is_key {
            items.extend(self.shapes().variants(&self.value).iter().map(variant_item));
            // By words, since an option or a choice may wrap the type.
            let is_bool = |node: &&'a Value| self.shapes().type_words(node).contains("true");
            if self.value.iter().any(is_bool) {
                items.extend(["true", "false"].map(|word| word_item(word, "")));
            }
        }
        items
    }

    fn missing_fields(&self, group: &RonGroup, is_key: bool) -> Vec<Item> {
        // The name at the cursor may be completed to itself.
        let others = group
            .keys
            .iter()
            .filter(|key| !key.contains(&self.at) && key.end != self.at);
        let written: Vec<&str> = others.map(|it| &self.text[it.clone()]).collect();
        let fields = self.shapes().fields(&self.inside).into_iter();
        fields
            .filter(|(name, _)| !written.contains(name))
            .map(|(name, node)| Item {
                label: name.to_owned(),
                kind: ItemKind::Field,
                detail: self.detail(name, node),
                about: self.shapes().about(node).unwrap_or_default().to_owned(),
                before: if is_key {
                    name.to_owned()
                } else {
                    format!("{name}: ")
                },
                behind: "",
            })
            .collect()
    }

    /// Names for the text in quotes at the place.
    fn names_here(&self) -> Vec<Item> {
        let Some(field) = self.field_name() else {
            return Vec::new();
        };
        let mut items: Vec<Item> = Vec::new();
        let kind = NameKind::of_field(field);
        if kind == Some(NameKind::Signal) {
            items.extend(self.names.iter().map(name_item));
            // Observations are names and no formulas.
            if field != "observe" {
                // The world itself knows `T`, once it can be used.
                let words = FORMULA_WORDS.map(|(word, about)| word_item(word, about));
                let is_known = |item: &Item| items.iter().any(|it| it.label == item.label);
                let more: Vec<Item> = words.into_iter().filter(|it| !is_known(it)).collect();
                items.extend(more);
            }
        }
        let own = kind.map_or(Vec::new(), |kind| declared(self.text, kind));
        // Own names first, which may replace a stock name.
        for name in own.into_iter().chain(self.language.stock_names(field)) {
            if !items.iter().any(|item| item.label == name) {
                items.push(name_item(&KnownName {
                    name,
                    unit: String::new(),
                    about: String::new(),
                }));
            }
        }
        items
    }
}

/// Dotted name at a place within a text in quotes.
fn name_around(text: &str, content: &Range<usize>, at: usize) -> Range<usize> {
    let is_name = |c: char| c.is_alphanumeric() || matches!(c, '_' | '.');
    let before = &text[content.start..at];
    // The cursor may be behind the content, at a missing quote.
    let behind = &text[at..content.end.max(at)];
    let start = at - (before.len() - before.trim_end_matches(is_name).len());
    let end = at + (behind.len() - behind.trim_start_matches(is_name).len());
    start..end
}

fn name_markdown(name: &KnownName) -> String {
    let unit = match name.unit.as_str() {
        "" => String::new(),
        unit => format!(" in {unit}"),
    };
    format!("`{}`{unit}\n\n{}", name.name, name.about)
        .trim_end()
        .to_owned()
}

fn variant_markdown(variant: &VariantShape<'_>) -> String {
    let brackets = if variant.content.is_some() {
        "(…)"
    } else {
        ""
    };
    format!("`{}{brackets}`\n\n{}", variant.name, variant.about)
        .trim_end()
        .to_owned()
}

/// A default in the notation of world files, if it is a single value.
fn short_ron(value: &Value) -> Option<String> {
    match value {
        Value::Bool(_) | Value::Number(_) => Some(value.to_string()),
        // Names begin with a capital, and texts are quoted in RON.
        Value::String(text) if text.starts_with(char::is_uppercase) => Some(text.clone()),
        Value::String(text) => Some(format!("{text:?}")),
        _ => None,
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::language::CheckedText;

    pub(crate) struct TestLanguage(pub(crate) Value);

    impl WorldLanguage for TestLanguage {
        fn check(&self, _: &str, _: &str) -> Option<CheckedText> {
            None
        }

        fn schema(&self) -> &Value {
            &self.0
        }

        fn stock_names(&self, field: &str) -> Vec<String> {
            let names: &[&str] = if field == "body" { &["sedan"] } else { &[] };
            names.iter().map(|name| (*name).to_owned()).collect()
        }
    }

    fn at<T>(marked: &str, then: impl FnOnce(Cursor<'_>) -> T) -> T {
        let at = marked.find('|').expect("a mark");
        let text = marked.replacen('|', "", 1);
        let language = TestLanguage(crate::shapes::tests::schema());
        let names = [KnownName {
            name: "ego.speed".to_owned(),
            unit: "m/s".to_owned(),
            about: "speed of the ego".to_owned(),
        }];
        then(Cursor::new(&text, at, &language, &names).expect("not deep"))
    }

    fn hovered(marked: &str) -> String {
        at(marked, |cursor| {
            let explained = cursor.hover();
            explained.map_or(String::new(), |it| it.markdown.replace("\n\n", "; "))
        })
    }

    #[test]
    fn hover_explains_fields_variants_and_names() {
        let cases = [
            (
                "S(pla|nt: Rigid)",
                "`plant`: one of Rigid, Kinematic, default `Rigid`; Motion.",
            ),
            ("S(plant: Ri|gid)", "`Rigid`; In three dimensions."),
            ("S(agents: [Vehi|cle(name: \"a\")])", "`Vehicle(…)`; Car."),
            (
                "S(agents: [Vehicle(start: At(x_|m: 1)])",
                "`x_m`: number in m, default `0.0`; Station.",
            ),
            (
                "S(agents: [Vehicle(start: At(x_m: 1.|5)])",
                "`x_m`: number in m, default `0.0`; Station.",
            ),
            (
                "S(agents: [Vehicle(start: At(speed_mps|: 1)])",
                "`speed_mps`: number in m/s",
            ),
            (
                "S(ego_spec: \"always (ego.spe|ed >= 0)\")",
                "`ego.speed` in m/s; speed of the ego",
            ),
            (
                "S(name: \"ego.spe|ed\")",
                "`name`: text; Name of the world.",
            ),
            ("S(nothing|: 1)", ""),
            ("S(// pla|nt\n)", ""),
        ];
        for (marked, expect) in cases {
            assert_eq!(hovered(marked), expect, "{marked}");
        }
    }

    fn completed(marked: &str) -> String {
        at(marked, |cursor| {
            let all = cursor.completions();
            let items = all.items.iter();
            let items = items.filter(|item| item.kind != ItemKind::Word || item.label == "T");
            let texts = items.map(|item| format!("{}{}", item.before, item.behind));
            let replaced = &cursor.text[all.span];
            format!("{replaced}> {}", texts.collect::<Vec<_>>().join(" "))
        })
    }

    #[test]
    fn completions_are_what_can_be_written() {
        let cases = [
            ("S(agents: [Vehicle(name: \"a\", |)])", "> drive:  start: "),
            (
                "S(agents: [Vehicle(name: \"a\", dr|, start: At())])",
                "dr> drive: ",
            ),
            (
                "S(agents: [Vehicle(name: \"a\", dr|: Ego())])",
                "dr> drive start",
            ),
            (
                "S(agents: [Vehicle(name: \"a\", drive|: Ego())])",
                "drive> drive start",
            ),
            ("S(plant: |)", "> Rigid Kinematic"),
            ("S(plant: K|)", "K> Rigid Kinematic"),
            ("S(agents: [|", "> Vehicle()"),
            ("S(agents: [Vehicle(drive: Ego(|", "> Acc()"),
            ("S(ego_spec: \"always (ego.|", "ego.> ego.speed T"),
            ("S(name: \"|\")", "> "),
            (
                "S(agents: [Vehicle(name: \"a\"), Vehicle(start: Ahead(of: \"|\"))])",
                "> a",
            ),
            ("S(agents: [Vehicle(body: \"|", "> sedan"),
            ("S(plant: // |", "> "),
        ];
        for (marked, expect) in cases {
            assert_eq!(completed(marked), expect, "{marked}");
        }
    }

    #[test]
    fn every_place_of_a_world_has_an_answer() {
        let language = TestLanguage(crate::shapes::tests::schema());
        let worlds = brakecheck_worlds::WORLDS.iter().take(6);
        for (name, text) in worlds {
            for end in (0..=text.len()).step_by(11) {
                let Some(prefix) = text.get(..end) else {
                    continue;
                };
                let cursor = Cursor::new(prefix, end, &language, &[]).expect(name);
                let _ = (cursor.hover(), cursor.completions());
            }
        }
    }
}
