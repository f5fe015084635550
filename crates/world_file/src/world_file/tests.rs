use brakecheck_worlds::WORLDS;
use serde_json::{Value, json};

use super::*;
use crate::ron_file::{ValuePath, parse_ron};

/// Returns the shipped worlds with their names.
fn shipped() -> impl Iterator<Item = (&'static str, WorldFile)> {
    let read = |text: &str| parse_ron::<WorldFile>(text).expect("a world");
    WORLDS.iter().map(move |(name, text)| (*name, read(text)))
}

#[test]
fn a_written_world_reads_as_an_equal_value() {
    for (name, world) in shipped() {
        let written = text(&world).expect("a text");
        let read: WorldFile = parse_ron(&written).unwrap_or_else(|problem| {
            panic!("{name}: {problem:?}\n{written}");
        });
        assert_eq!(read, world, "{name}\n{written}");
        let json = serde_json::to_value(&world).expect("JSON");
        let read: WorldFile = serde_json::from_value(json).expect("a world of JSON");
        // JSON objects have no order, which `Ordered` does not compare.
        assert_eq!(read, world, "{name}");
    }
}

#[test]
fn comments_precede_their_values_and_change_nothing() {
    let paths: [&dyn Fn(ValuePath) -> ValuePath; 4] = [
        &|top| top,
        &|top| top.to("clock").to("sample_s"),
        &|top| top.to("agents").at(0),
        &|top| top.to("agents").at(0).to("name"),
    ];
    let paths = paths.map(|path| path(ValuePath::top()));
    let comments =
        paths.map(|it| TextComment::new(it.clone(), format!("above `{it}`\n\n(\"\u{7}")));
    let mut count = 0;
    for (name, world) in shipped() {
        if !matches!(world, WorldFile::Scenario(_)) {
            continue;
        }
        count += 1;
        let mut commented = CommentedWorld {
            world,
            comments: comments.to_vec(),
        };
        let written = commented.text().expect("a text");
        assert_eq!(
            parse(name, &written),
            Ok(commented.world.clone()),
            "{written}"
        );
        for comment in &comments {
            let block = format!("// above `{}`\n", comment.at);
            let (_, after) = written.split_once(&block).expect("the comment");
            let lines: Vec<&str> = after.lines().map(str::trim).take(3).collect();
            assert_eq!(lines[..2], ["//", "// (\"_"]);
            // The line below is that of the value, so its place begins there.
            let below = after.lines().nth(2).expect("a line");
            let begins = written.len() - after.len() + after.find(below).expect("it is there");
            let found = comment.at.find(&written).start;
            assert!((begins..begins + below.len()).contains(&found), "{written}");
        }
        let nowhere = ValuePath::top().to("agents").at(99);
        commented.comments.push(TextComment::new(nowhere, "lost"));
        let refused = commented.text().map_err(|it| it.to_string());
        assert!(refused.is_err_and(|it| it.contains("agents[99]")), "{name}");
    }
    // Nearly all shipped worlds are driving worlds, so a small count is a broken filter.
    assert!(count > 30, "{count}");
}

#[test]
fn a_comment_of_a_field_that_is_left_out_is_refused() {
    let (_, world) = shipped().find(|(name, _)| *name == "acc").expect("shipped");
    let ego = ValuePath::top().to("reuse").to("wet road");
    let text = |field: &str| {
        let comments = vec![TextComment::new(ego.to(field), "explained")];
        let world = world.clone();
        CommentedWorld { world, comments }.text()
    };
    assert!(text("friction").is_ok());
    assert!(text("plant").is_err());
}

#[test]
fn a_comment_finds_a_key_with_escapes() {
    let (_, acc) = WORLDS
        .iter()
        .find(|(name, _)| *name == "acc")
        .expect("shipped");
    let key = "\"wet\" \\ road";
    let acc = acc.replace("\"wet road\"", &format!("{key:?}"));
    let world = parse_ron::<WorldFile>(&acc).expect("a world");
    let at = ValuePath::top().to("reuse").to(key);
    let comments = vec![TextComment::new(at, "explained")];
    let commented = CommentedWorld { world, comments };
    let written = commented.text().expect("a text");
    assert!(
        written.contains(&format!("// explained\n        {key:?}: ")),
        "{written}"
    );
    let read: WorldFile =
        parse_ron(&written).unwrap_or_else(|problem| panic!("{problem:?}\n{written}"));
    assert_eq!(read, commented.world);
}

#[test]
fn a_text_has_lines_that_fit_and_the_shortest_that_do() {
    for (name, world) in shipped() {
        let written = text(&world).expect("a text");
        let lines: Vec<&str> = written.lines().collect();
        for (i, line) in lines.iter().enumerate() {
            // A longer line is a single value, such as a formula, with its name.
            let is_one = |it: &str| it.matches(": ").count() <= 1 || it.contains('"');
            assert!(
                line.chars().count() <= 100 || is_one(line),
                "{name}: {line}"
            );
            // A group whose values fit into a line has no line per value.
            if let [open, inner, close] = lines[i..(i + 3).min(lines.len())]
                && open.ends_with(['(', '['])
                && [")", "),", "]", "],"].contains(&close.trim())
                && !inner.ends_with(['(', '[', '{'])
            {
                let width = open.chars().count() + inner.trim().chars().count();
                assert!(width + close.trim().len() > 100, "{name}: {open}\n{inner}");
            }
        }
    }
}

/// Returns the place and the reason for which a schema refuses a value.
fn refused(root: &Value, schema: &Value, value: &Value, place: &str) -> Result<(), String> {
    let fail = |why: &str| Err(format!("{place}: {why}"));
    let keywords = match schema {
        Value::Bool(true) => return Ok(()),
        Value::Bool(false) => return fail("never valid"),
        Value::Object(keywords) => keywords,
        _ => panic!("{place}: no schema"),
    };
    let each = |schemas: &Value| -> Vec<Result<(), String>> {
        let schemas = schemas.as_array().expect("schemas").iter();
        schemas.map(|it| refused(root, it, value, place)).collect()
    };
    for (keyword, stated) in keywords {
        let holds = match keyword.as_str() {
            // These say nothing about validity.
            "$schema" | "$defs" | "title" | "description" | "default" | "format" => true,
            "$ref" => {
                let target = stated.as_str().and_then(|it| it.strip_prefix('#'));
                let target = root.pointer(target.expect("a place in this schema"));
                refused(root, target.expect("a definition"), value, place)?;
                true
            }
            "type" => match stated {
                Value::Array(types) => types.iter().any(|it| is_of_type(value, it)),
                one => is_of_type(value, one),
            },
            "const" => value == stated,
            "enum" => stated.as_array().expect("values").contains(value),
            // Keywords about numbers hold for a value of any other type.
            "minimum" => value.as_f64().is_none_or(|it| Some(it) >= stated.as_f64()),
            "maximum" => value.as_f64().is_none_or(|it| Some(it) <= stated.as_f64()),
            "minItems" => value
                .as_array()
                .is_none_or(|it| Some(it.len() as u64) >= stated.as_u64()),
            "maxItems" => value
                .as_array()
                .is_none_or(|it| Some(it.len() as u64) <= stated.as_u64()),
            "oneOf" => each(stated).iter().filter(|it| it.is_ok()).count() == 1,
            "anyOf" => each(stated).iter().any(Result::is_ok),
            "required" => value.as_object().is_none_or(|object| {
                let names = stated.as_array().expect("names");
                names
                    .iter()
                    .all(|it| object.contains_key(it.as_str().expect("a name")))
            }),
            "properties" => {
                for (name, schema) in stated.as_object().expect("properties") {
                    if let Some(inner) = value.get(name) {
                        refused(root, schema, inner, &format!("{place}/{name}"))?;
                    }
                }
                true
            }
            "additionalProperties" => {
                // The keyword concerns the names that `properties` does not list.
                let known = schema.get("properties").and_then(Value::as_object);
                for (name, inner) in value.as_object().into_iter().flatten() {
                    if known.is_none_or(|known| !known.contains_key(name)) {
                        refused(root, stated, inner, &format!("{place}/{name}"))?;
                    }
                }
                true
            }
            "propertyNames" => {
                for name in value.as_object().into_iter().flat_map(|it| it.keys()) {
                    refused(root, stated, &json!(name), place)?;
                }
                true
            }
            "prefixItems" => {
                let schemas = stated.as_array().expect("schemas").iter();
                for (i, (inner, schema)) in value
                    .as_array()
                    .into_iter()
                    .flatten()
                    .zip(schemas)
                    .enumerate()
                {
                    refused(root, schema, inner, &format!("{place}/{i}"))?;
                }
                true
            }
            "items" => {
                // The keyword concerns the elements behind those of `prefixItems`.
                let first = schema.get("prefixItems").and_then(Value::as_array);
                let rest = value.as_array().into_iter().flatten().enumerate();
                for (i, inner) in rest.skip(first.map_or(0, Vec::len)) {
                    refused(root, stated, inner, &format!("{place}/{i}"))?;
                }
                true
            }
            other => panic!("{place}: the schema has the keyword `{other}`"),
        };
        if !holds {
            return fail(&format!("{keyword} {stated}"));
        }
    }
    Ok(())
}

fn is_of_type(value: &Value, name: &Value) -> bool {
    match name.as_str() {
        Some("null") => value.is_null(),
        Some("boolean") => value.is_boolean(),
        Some("string") => value.is_string(),
        Some("number") => value.is_number(),
        Some("integer") => value.is_i64() || value.is_u64(),
        Some("array") => value.is_array(),
        Some("object") => value.is_object(),
        other => panic!("a type {other:?}"),
    }
}

#[test]
fn every_shipped_world_satisfies_the_schema() {
    let schema = schema();
    for (name, world) in shipped() {
        let json = serde_json::to_value(&world).expect("JSON");
        refused(&schema, &schema, &json, name).expect("a valid world");
    }
}

/// Calls `visit` with the path of every value inside.
fn places(value: &Value, path: &str, visit: &mut dyn FnMut(&str)) {
    visit(path);
    match value {
        Value::Object(fields) => fields
            .iter()
            .for_each(|(name, inner)| places(inner, &format!("{path}/{name}"), visit)),
        Value::Array(items) => items
            .iter()
            .enumerate()
            .for_each(|(i, inner)| places(inner, &format!("{path}/{i}"), visit)),
        _ => {}
    }
}

/// The reader is the measure: what it reads the schema admits, and nothing else.
#[test]
fn the_schema_and_the_reader_refuse_the_same_mistakes() {
    let schema = schema();
    let wrong = [
        json!(null),
        json!("text"),
        json!(17.5),
        json!(-1),
        json!(true),
        json!({}),
    ];
    let mut refusals = 0;
    for (name, world) in shipped() {
        let json = serde_json::to_value(&world).expect("JSON");
        let mut paths = Vec::new();
        places(&json, "", &mut |path| paths.push(path.to_owned()));
        let mut compare = |mistaken: &Value, path: &str, mistake: &str| {
            let admitted = refused(&schema, &schema, mistaken, "");
            let read: Result<WorldFile, _> = serde_json::from_value(mistaken.clone());
            assert_eq!(
                admitted.is_ok(),
                read.is_ok(),
                "{name}{path}, {mistake}: {admitted:?}, {:?}",
                read.err()
            );
            refusals += usize::from(admitted.is_err());
        };
        // Every seventh place suffices, because the worlds resemble each other.
        for path in paths.iter().step_by(7) {
            for value in &wrong {
                let mut mistaken = json.clone();
                *mistaken.pointer_mut(path).expect("a place") = value.clone();
                compare(&mistaken, path, &value.to_string());
            }
            let object =
                |world: &mut Value, change: &dyn Fn(&mut serde_json::Map<String, Value>)| {
                    world
                        .pointer_mut(path)
                        .and_then(Value::as_object_mut)
                        .map(change)
                };
            let mut mistaken = json.clone();
            let extended = object(&mut mistaken, &|fields| {
                fields.insert("unknown_field".into(), json!(1));
            });
            if extended.is_some() {
                compare(&mistaken, path, "unknown field");
            }
            let mut mistaken = json.clone();
            let shortened = object(&mut mistaken, &|fields| {
                let first = fields.keys().next().cloned();
                first.map(|it| fields.remove(&it));
            });
            if shortened.is_some() {
                compare(&mistaken, path, "first field removed");
            }
        }
    }
    // Without refusals, both sides would only have agreed on sound worlds.
    assert!(refusals > 1000, "{refusals}");
}

#[test]
fn the_schema_describes_every_field_and_names_every_shape() {
    let schema = schema();
    let definitions = schema["$defs"].as_object().expect("definitions");
    for (name, shape) in definitions {
        // A number at the end is that of a second shape with the same name.
        assert!(!name.ends_with(|it: char| it.is_ascii_digit()), "{name}");
        // schemars joins a generic type and its parameter by this word.
        assert!(!name.contains("_for_"), "{name}");
        // Two types of one name in one module would become one definition.
        let itself = json!({ "$ref": format!("#/$defs/{name}") });
        let forms = ["anyOf", "oneOf"].map(|it| shape.get(it).and_then(Value::as_array));
        assert!(
            !forms
                .into_iter()
                .flatten()
                .flatten()
                .any(|it| *it == itself),
            "{name}"
        );
        let mut silent = Vec::new();
        places(shape, "", &mut |path| {
            let value = shape.pointer(path).expect("a place");
            let is_field = path.rsplit_once('/').is_some_and(|(above, field)| {
                above.ends_with("/properties") && field.starts_with(|it: char| it.is_lowercase())
            });
            if is_field && value.get("description").is_none() {
                silent.push(path.to_owned());
            }
        });
        assert!(silent.is_empty(), "{name}: {silent:?}");
    }
}
