//! Shapes of values: the nodes of a JSON Schema along a path of a RON text.
//!
//! Enums are tagged by their variant: `"Rigid"`, or `{"Vehicle": {…}}`, which RON writes
//! `Rigid` and `Vehicle(…)`. A single inner value needs no brackets of its own.

use serde_json::{Map, Value};

use crate::outline::RonGroup;

/// Greatest number of references and choices that are followed for one value.
const MAX_STEPS: usize = 1000;

/// Schema of a kind of file.
#[derive(Clone, Copy)]
pub struct Shapes<'a> {
    root: &'a Value,
}

/// Variant of an enum.
#[derive(Clone, Copy)]
pub struct VariantShape<'a> {
    /// Name of the variant.
    pub name: &'a str,
    /// Description, empty without one.
    pub about: &'a str,
    /// Content, if it has any.
    pub content: Option<&'a Value>,
}

impl<'a> Shapes<'a> {
    /// Returns the shapes of a schema with all its definitions.
    pub fn new(root: &'a Value) -> Shapes<'a> {
        Shapes { root }
    }

    /// Returns the nodes of the value at the end of a path, and of the group around it.
    ///
    /// The first group is the file's value.
    pub fn along(&self, text: &str, groups: &[RonGroup]) -> (Vec<&'a Value>, Vec<&'a Value>) {
        let mut value = vec![self.root];
        let mut inside = Vec::new();
        for group in groups {
            let word = &text[group.word.clone()];
            // The content first, because the key is one of its fields.
            inside = self.entered(&value, group, word);
            let key = group.key.clone().map(|key| &text[key]);
            value = self.child(&inside, group, key);
        }
        (value, inside)
    }

    /// Nodes of the content of a group.
    fn entered(&self, value: &[&'a Value], group: &RonGroup, word: &str) -> Vec<&'a Value> {
        // Lists, maps and structs without a name have no variant to select.
        if group.bracket != '(' || word.is_empty() {
            return value.to_vec();
        }
        let variants = self.variants(value).into_iter();
        let named: Vec<&Value> = variants
            .filter(|variant| variant.name == word)
            .filter_map(|variant| variant.content)
            .collect();
        if named.is_empty() {
            // The name of a struct before its brackets is no variant.
            value.to_vec()
        } else {
            named
        }
    }

    /// Nodes of the current value of a group.
    fn child(&self, inside: &[&'a Value], group: &RonGroup, key: Option<&str>) -> Vec<&'a Value> {
        let all = self.choices(inside).into_iter();
        match (group.bracket, key) {
            ('(', Some(key)) => self.field(inside, key).into_iter().collect(),
            ('{', Some(key)) => all.filter_map(|node| map_value(node, key)).collect(),
            // Before its colon, a key of a map has no shape.
            ('{', None) => Vec::new(),
            // A tuple first, whose elements differ. Those of a list are all
            // alike.
            ('[', _) => all
                .filter_map(|node| element(node, group.index).or_else(|| node.get("items")))
                .collect(),
            _ => {
                let elements: Vec<&Value> = self
                    .choices(inside)
                    .into_iter()
                    .filter_map(|node| element(node, group.index))
                    .collect();
                // `Ego(Acc(…))`: the content is the value itself.
                if elements.is_empty() && group.index == 0 {
                    inside.to_vec()
                } else {
                    elements
                }
            }
        }
    }

    /// Returns the node of a field.
    pub fn field(&self, inside: &[&'a Value], name: &str) -> Option<&'a Value> {
        let mut fields = self.fields(inside).into_iter();
        fields.find(|(known, _)| *known == name).map(|(_, it)| it)
    }

    /// Returns the fields of structs, with their nodes.
    pub fn fields(&self, inside: &[&'a Value]) -> Vec<(&'a str, &'a Value)> {
        let structs = self.choices(inside).into_iter();
        structs
            // Variants with content are objects of one property, and no
            // structs.
            .filter(|node| tagged(node).is_none())
            .filter_map(properties)
            .flatten()
            .map(|(name, node)| (name.as_str(), node))
            .collect()
    }

    /// Returns the variants of enums.
    pub fn variants(&self, value: &[&'a Value]) -> Vec<VariantShape<'a>> {
        let mut variants = Vec::new();
        for node in self.choices(value) {
            let about = described(node).unwrap_or_default();
            let unit = |name| VariantShape {
                name,
                about,
                content: None,
            };
            if let Some((name, content)) = tagged(node) {
                variants.push(VariantShape {
                    name,
                    about: described(node)
                        .or_else(|| self.about(content))
                        .unwrap_or_default(),
                    content: Some(content),
                });
            } else if let Some(name) = node.get("const").and_then(Value::as_str) {
                variants.push(unit(name));
            } else if let Some(names) = node.get("enum").and_then(Value::as_array) {
                variants.extend(names.iter().filter_map(Value::as_str).map(unit));
            }
        }
        variants
    }

    /// Returns the description of a node, or of the definition that it refers to.
    pub fn about(&self, node: &'a Value) -> Option<&'a str> {
        described(node).or_else(|| {
            let target = node.get("$ref").and_then(|it| self.target(it))?;
            described(target)
        })
    }

    /// Returns the type of a node in words.
    pub fn type_words(&self, node: &'a Value) -> String {
        let variants = self.variants(&[node]);
        if !variants.is_empty() {
            let names: Vec<&str> = variants.iter().map(|variant| variant.name).collect();
            return format!("one of {}", names.join(", "));
        }
        let words = self.choices(&[node]).into_iter().filter_map(type_word);
        let mut unique: Vec<&str> = Vec::new();
        for word in words {
            if !unique.contains(&word) {
                unique.push(word);
            }
        }
        unique.join(" or ")
    }

    /// Nodes without references and choices, those of `null` left out.
    fn choices(&self, nodes: &[&'a Value]) -> Vec<&'a Value> {
        let mut found = Vec::new();
        let mut followed = Vec::new();
        // Reversed, since a stack gives the last first and completions keep
        // the schema's order.
        let mut open: Vec<&Value> = nodes.iter().rev().copied().collect();
        // A schema of many nested choices would otherwise take exponential
        // time.
        for _ in 0..MAX_STEPS {
            let Some(node) = open.pop() else { break };
            // A shape may refer to itself.
            if let Some(reference) = node.get("$ref").filter(|it| !followed.contains(it)) {
                followed.push(reference);
                open.extend(self.target(reference));
            }
            for choice in ["oneOf", "anyOf", "allOf"] {
                let list = node.get(choice).and_then(Value::as_array);
                open.extend(list.into_iter().flatten().rev());
            }
            // Nodes with a description alone constrain nothing.
            let shaping = ["type", "properties", "const", "enum", "items"];
            let is_null = node.get("type").is_some_and(|kind| kind == "null");
            if !is_null && shaping.iter().any(|key| node.get(key).is_some()) {
                found.push(node);
            }
        }
        found
    }

    fn target(&self, reference: &Value) -> Option<&'a Value> {
        let pointer = reference.as_str()?.strip_prefix('#')?;
        self.root.pointer(pointer)
    }
}

fn described(node: &Value) -> Option<&str> {
    node.get("description").and_then(Value::as_str)
}

fn properties(node: &Value) -> Option<&Map<String, Value>> {
    node.get("properties").and_then(Value::as_object)
}

/// Name and content of a variant `{"Name": content}`.
fn tagged(node: &Value) -> Option<(&str, &Value)> {
    let mut fields = properties(node)?.iter();
    let (name, content) = fields.next()?;
    // Fields are lower case, and variants are not.
    let is_variant = name.starts_with(char::is_uppercase) && fields.next().is_none();
    is_variant.then_some((name, content))
}

/// Element of a tuple.
fn element(node: &Value, index: usize) -> Option<&Value> {
    node.get("prefixItems")?.get(index)
}

/// Value of a map under a key.
fn map_value<'a>(node: &'a Value, key: &str) -> Option<&'a Value> {
    let own = properties(node).and_then(|fields| fields.get(key));
    own.or_else(|| node.get("additionalProperties").filter(|it| it.is_object()))
}

fn type_word(node: &Value) -> Option<&'static str> {
    let kind = match node.get("type")? {
        // A list of types has `null` besides the type of the value.
        Value::Array(kinds) => kinds.iter().find(|kind| **kind != "null")?,
        kind => kind,
    };
    Some(match kind.as_str()? {
        "number" => "number",
        "integer" => "whole number",
        "string" => "text",
        "boolean" => "true or false",
        "array" if node.get("prefixItems").is_some() => "(…, …)",
        "array" => "list",
        "object" if properties(node).is_some() => "(…)",
        "object" => "map",
        _ => return None,
    })
}

#[cfg(test)]
pub(crate) mod tests {
    use serde_json::json;

    use super::*;
    use crate::outline::Outline;

    /// A schema of all forms that worlds have.
    pub(crate) fn schema() -> Value {
        json!({
            "type": "object",
            "description": "World of a drive.",
            "properties": {
                "name": { "type": "string", "description": "Name of the world." },
                "plant": { "$ref": "#/$defs/Plant", "description": "Motion.", "default": "Rigid" },
                "agents": { "type": "array", "items": { "$ref": "#/$defs/Agent" } },
                "signals": {
                    "type": "object",
                    "additionalProperties": { "anyOf": [{ "type": "string" }, { "$ref": "#/$defs/Signal" }] },
                },
                "grades": {
                    "type": "array",
                    "items": { "type": "array", "prefixItems": [{ "type": "number" }, { "$ref": "#/$defs/Plant" }] },
                },
                "own": { "anyOf": [{ "$ref": "#/$defs/Plant" }, { "type": "null" }] },
                "around": { "$ref": "#/$defs/Around" },
                "ego_spec": { "type": "string" },
            },
            "$defs": {
                "Around": { "anyOf": [{ "$ref": "#/$defs/Around" }, { "type": "number" }] },
                "Plant": {
                    "oneOf": [
                        { "type": "string", "const": "Rigid", "description": "In three dimensions." },
                        { "type": "string", "enum": ["Kinematic"] },
                    ],
                },
                "Signal": { "type": "object", "properties": { "expr": { "type": "string" } } },
                "Agent": {
                    "oneOf": [{
                        "type": "object",
                        "required": ["Vehicle"],
                        "properties": { "Vehicle": {
                            "type": "object",
                            "description": "Car.",
                            "properties": {
                                "name": { "type": "string" },
                                "start": { "$ref": "#/$defs/Start" },
                                "drive": { "$ref": "#/$defs/Drive" },
                            },
                        } },
                    }],
                },
                "Start": {
                    "oneOf": [{
                        "type": "object",
                        "required": ["At"],
                        "properties": { "At": {
                            "type": "object",
                            "properties": {
                                "x_m": { "type": "number", "description": "Station.", "default": 0.0 },
                                "speed_mps": { "type": ["number", "null"] },
                            },
                        } },
                    }],
                },
                "Drive": {
                    "oneOf": [{
                        "type": "object",
                        "required": ["Ego"],
                        "properties": { "Ego": { "$ref": "#/$defs/Controller" } },
                    }],
                },
                "Controller": {
                    "oneOf": [{
                        "type": "object",
                        "required": ["Acc"],
                        "properties": { "Acc": {
                            "type": "object",
                            "properties": { "kp_per_s2": { "type": "number" } },
                        } },
                    }],
                },
            },
        })
    }

    /// The fields around, and the variants of the value, at `|`.
    fn shown(marked: &str) -> String {
        let at = marked.find('|').expect("a mark");
        let text = marked.replacen('|', "", 1);
        let outline = Outline::at(&text, at).expect("not deep");
        let schema = schema();
        let shapes = Shapes::new(&schema);
        let (value, inside) = shapes.along(&text, &outline.groups);
        let fields: Vec<&str> = shapes
            .fields(&inside)
            .iter()
            .map(|(name, _)| *name)
            .collect();
        let variants = shapes.variants(&value);
        let variants: Vec<&str> = variants.iter().map(|it| it.name).collect();
        let value = value
            .first()
            .map_or(String::new(), |it| shapes.type_words(it));
        format!("{}; {}; {value}", fields.join(" "), variants.join(" "))
    }

    #[test]
    fn values_have_the_shape_of_their_path() {
        let cases = [
            (
                "S(plant: |",
                "agents around ego_spec grades name own plant signals; Rigid Kinematic; one of Rigid, Kinematic",
            ),
            (
                "S(own: |",
                "agents around ego_spec grades name own plant signals; Rigid Kinematic; one of Rigid, Kinematic",
            ),
            ("S(agents: [|", "; Vehicle; one of Vehicle"),
            (
                "S(agents: [Vehicle(drive: |",
                "drive name start; Ego; one of Ego",
            ),
            ("S(agents: [Vehicle(drive: Ego(|", "; Acc; one of Acc"),
            (
                "S(agents: [Vehicle(drive: Ego(Acc(kp_per_s2: |",
                "kp_per_s2; ; number",
            ),
            (
                "S(agents: [Vehicle(start: At(speed_mps: |",
                "speed_mps x_m; ; number",
            ),
            ("S(signals: {\"a\": Signal(expr: |", "expr; ; text"),
            ("S(signals: {\"a\": |", "; ; text or (…)"),
            (
                "S(grades: [(1.0, |",
                "; Rigid Kinematic; one of Rigid, Kinematic",
            ),
            (
                "S(around: |",
                "agents around ego_spec grades name own plant signals; ; number",
            ),
            ("S(nothing: (a: |", "; ; "),
        ];
        for (marked, expect) in cases {
            assert_eq!(shown(marked), expect, "{marked}");
        }
    }
}
