//! `check --schema`: the schema that editors read, and `check` refuse the same mistakes.

use brakecheck::world_file;
use serde_json::{Value, json};

use super::{brakecheck, code, json as printed, refusal, root, scratch, stderr};

/// Returns the field for which a schema refuses the fields of a driving world.
fn refused_field(schema: &Value, world: &Value) -> Option<String> {
    let shape = &schema["$defs"]["Scenario"];
    let known = shape["properties"].as_object().expect("properties");
    let fields = world.as_object().expect("fields");
    let is_wrong = |name: &String, value: &Value| match known.get(name) {
        None => shape["additionalProperties"] == false,
        Some(field) => field["type"] == "string" && !value.is_string(),
    };
    let wrong = fields.iter().find(|(name, value)| is_wrong(name, value));
    let required = shape["required"].as_array().expect("required fields");
    let mut names = required.iter().filter_map(Value::as_str);
    wrong.map(|(name, _)| name.clone()).or_else(|| {
        names
            .find(|it| !fields.contains_key(*it))
            .map(str::to_owned)
    })
}

#[test]
fn the_schema_is_printed_and_refuses_the_mistakes_that_check_refuses() {
    let output = brakecheck(&["check", "--schema"]);
    assert_eq!((code(&output), &*stderr(&output)), (0, ""));
    let schema = printed(&output);
    let draft = "https://json-schema.org/draft/2020-12/schema";
    assert_eq!(schema["$schema"], draft);
    let kinds = schema["oneOf"].as_array().expect("kinds of worlds");
    let kind = |it: &Value| it["required"][0].as_str().map(str::to_owned);
    let kinds: Vec<_> = kinds.iter().filter_map(kind).collect();
    assert_eq!(kinds, ["Scenario", "Grid"]);

    let text = std::fs::read_to_string(root().join("worlds/acc.ron")).expect("a world");
    let sound = world_file::parse("acc.ron", &text).expect("a world");
    let sound = serde_json::to_value(sound).expect("JSON")["Scenario"].take();
    assert_eq!(refused_field(&schema, &sound), None);

    // A name without quotes, a field that is unknown, and one that is missing.
    let mistakes = [
        ("name: \"acc\"", "name: 3", "name"),
        ("name: \"acc\"", "name: \"acc\", colour: 1", "colour"),
        ("ego_spec:", "requirement:", "ego_spec"),
    ];
    let dir = scratch();
    for (from, to, field) in mistakes {
        let mut wrong = sound.clone();
        let fields = wrong.as_object_mut().expect("fields");
        match field {
            "name" => fields.insert(field.to_owned(), json!(3)),
            "colour" => fields.insert(field.to_owned(), json!(1)),
            _ => fields.remove(field),
        };
        assert_eq!(refused_field(&schema, &wrong).as_deref(), Some(field));
        assert_eq!(text.matches(from).count(), 1, "{from}");
        let file = dir.path().join("wrong.ron");
        std::fs::write(&file, text.replace(from, to)).expect("written");
        let refused = brakecheck(&["check", &file.display().to_string()]);
        let said = refusal(&refused, field);
        assert!(said.contains("wrong.ron"), "{said}");
    }
    // Options of a world have no meaning for the schema.
    refusal(
        &brakecheck(&["check", "worlds/acc.ron", "--schema"]),
        "--schema",
    );
}
