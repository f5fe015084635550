//! Shapes of a JSON schema as rows of tables: name, type, default and meaning.

use serde_json::Value;

/// Name, type, default and meaning of a field or a variant.
pub(super) type ShapeRow = [String; 4];

/// Returns the shape of a name, `null` for an unknown name.
pub(super) fn named<'a>(schema: &'a Value, name: &str) -> &'a Value {
    &schema["$defs"][name]
}

/// Returns a row per field of a struct, or per variant of an enum and its fields.
pub(super) fn rows(shape: &Value) -> Vec<ShapeRow> {
    let mut rows = fields(shape, "");
    let row = |name, kind, about| [name, kind, String::new(), about];
    for form in forms(shape) {
        let about = meaning(form).0;
        if let Some((name, content)) = variant(form) {
            // Fields have rows of their own.
            let kind = content.filter(|it| it.get("properties").is_none());
            rows.push(row(
                code(name),
                kind.map(type_of).unwrap_or_default(),
                about,
            ));
            let inside = content.map(|it| fields(it, &format!("{name}.")));
            rows.extend(inside.unwrap_or_default());
        } else if let Some(words) = form.get("enum").and_then(Value::as_array) {
            let words = words.iter().filter_map(Value::as_str);
            rows.extend(words.map(|it| row(code(it), String::new(), String::new())));
        } else {
            // A form without a name, such as a short spelling, is known by its type.
            rows.push(row(String::new(), type_of(form), about));
        }
    }
    rows
}

/// Returns the variants of an enum, each with its meaning.
pub(super) fn variants(shape: &Value) -> Vec<(String, String)> {
    let named = |form| Some((variant(form)?.0.to_owned(), meaning(form).0));
    forms(shape).into_iter().filter_map(named).collect()
}

/// Returns the first paragraph about a shape.
pub(super) fn about(shape: &Value) -> String {
    meaning(shape).0
}

fn fields(shape: &Value, before: &str) -> Vec<ShapeRow> {
    let required = shape.get("required").and_then(Value::as_array);
    let is_required = |name: &str| required.is_some_and(|all| all.iter().any(|it| it == name));
    let properties = shape.get("properties").and_then(Value::as_object);
    // A name in upper case is that of a variant.
    let shown = properties
        .into_iter()
        .flatten()
        .filter(|(name, _)| name.starts_with(char::is_lowercase));
    // A reader who writes a new value needs the required fields first.
    let (first, rest): (Vec<_>, Vec<_>) = shown.partition(|(name, _)| is_required(name));
    let rows = first.into_iter().chain(rest).map(|(name, field)| {
        let (meaning, stated) = meaning(field);
        let default = match (field.get("default"), stated) {
            // The stated default is in words, which say more than a value.
            (_, Some(stated)) => stated,
            (Some(value), None) => code(&ron(value)),
            (None, None) if is_required(name) => "required".to_owned(),
            (None, None) => "optional".to_owned(),
        };
        let name = code(&format!("{before}{name}"));
        [name, type_of(field), default, meaning]
    });
    rows.collect()
}

/// Returns the alternatives of a shape, or the shape itself if it lists words.
fn forms(shape: &Value) -> Vec<&Value> {
    let lists = ["oneOf", "anyOf"].map(|it| shape.get(it).and_then(Value::as_array));
    let forms: Vec<&Value> = lists.into_iter().flatten().flatten().collect();
    let is_word = forms.is_empty() && shape.get("properties").is_none();
    if is_word { vec![shape] } else { forms }
}

/// Returns the name and the content of a variant, if a form is one.
fn variant(form: &Value) -> Option<(&str, Option<&Value>)> {
    if let Some(name) = form.get("const").and_then(Value::as_str) {
        return Some((name, None));
    }
    // In the schema, a variant with content is an object with its name as the only key.
    let mut properties = form.get("properties")?.as_object()?.iter();
    let (name, content) = properties.next()?;
    name.starts_with(char::is_uppercase)
        .then_some((name.as_str(), Some(content)))
}

/// Returns the first paragraph of a description, and the default that it states.
fn meaning(node: &Value) -> (String, Option<String>) {
    let text = node
        .get("description")
        .and_then(Value::as_str)
        .unwrap_or_default();
    // Later paragraphs have examples, for which a table cell has no room.
    let paragraph = text.split("\n\n").next().unwrap_or_default();
    let words: Vec<&str> = paragraph.split_whitespace().collect();
    // Links of rustdoc lead nowhere here.
    let line = words.join(" ").replace("[`", "`").replace("`]", "`");
    match line.split_once(" Default: ") {
        Some((meaning, default)) => {
            let default = default.trim_end_matches('.').to_owned();
            (meaning.to_owned(), Some(default))
        }
        None => (line, None),
    }
}

/// Returns the type of a node, in which shapes have their names.
fn type_of(node: &Value) -> String {
    if let Some(name) = node.get("$ref").and_then(Value::as_str) {
        return code(name.rsplit('/').next().unwrap_or_default());
    }
    let is_null = |it: &&Value| it.get("type").is_some_and(|it| it == "null");
    for choice in ["oneOf", "anyOf"] {
        if let Some(all) = node.get(choice).and_then(Value::as_array) {
            let all: Vec<String> = all.iter().filter(|it| !is_null(it)).map(type_of).collect();
            return all.join(" or ");
        }
    }
    let kind = match node.get("type") {
        // An `Option` has two types in the schema, and world files write the inner one.
        Some(Value::Array(kinds)) => kinds.iter().find(|kind| **kind != "null"),
        kind => kind,
    };
    match kind.and_then(Value::as_str).unwrap_or_default() {
        "integer" => "whole number".to_owned(),
        "string" => "text".to_owned(),
        "boolean" => "true or false".to_owned(),
        "array" => list_of(node),
        "object" => match node.get("additionalProperties") {
            // A struct has `false` here, and only a map has the shape of its values.
            Some(inner) if inner.is_object() => format!("map of {}", type_of(inner)),
            _ => String::new(),
        },
        other => other.to_owned(),
    }
}

fn list_of(node: &Value) -> String {
    let elements = node.get("prefixItems").and_then(Value::as_array);
    match (elements, node.get("items")) {
        // A tuple has a shape per position, and a list has one for all values.
        (Some(all), _) => {
            let all: Vec<String> = all.iter().map(type_of).collect();
            format!("({})", all.join(", "))
        }
        (None, Some(items)) => format!("list of {}", type_of(items)),
        (None, None) => "list".to_owned(),
    }
}

/// Returns a value in the notation of world files, without the fields of structs.
fn ron(value: &Value) -> String {
    match value {
        Value::Null => "None".to_owned(),
        // RON writes a variant without quotes, and JSON has it as a text.
        Value::String(word) if word.starts_with(char::is_uppercase) => word.clone(),
        Value::Array(all) => {
            let all: Vec<String> = all.iter().map(ron).collect();
            format!("[{}]", all.join(", "))
        }
        Value::Object(fields) => match fields.iter().next() {
            None => "{}".to_owned(),
            Some((name, _)) if name.starts_with(char::is_lowercase) => "(…)".to_owned(),
            Some((name, content)) if content.is_object() => format!("{name}(…)"),
            Some((name, content)) => format!("{name}({})", ron(content)),
        },
        other => other.to_string(),
    }
}

fn code(text: &str) -> String {
    format!("`{text}`")
}
