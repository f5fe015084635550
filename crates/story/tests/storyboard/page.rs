//! The page of world files names all actions, conditions and places.

use brakecheck_story::values::{Effect, EntityCondition, Expression, StoryPosition};
use schemars::{JsonSchema, schema_for};

const PAGE: &str = include_str!("../../../../docs/reference/world-file.md");

/// Returns the names of an enum's variants.
fn variants<T: JsonSchema>() -> Vec<String> {
    let schema = schema_for!(T);
    let all = schema.get("oneOf").and_then(|it| it.as_array());
    let names = all.into_iter().flatten().filter_map(|it| {
        let required = it.get("required")?.as_array()?;
        Some(required.first()?.as_str()?.to_owned())
    });
    names.collect()
}

#[test]
fn the_page_names_all_actions_conditions_and_places() {
    let part = PAGE.split("## Storyboard").nth(1).unwrap_or_default();
    let part = part.split("\n## ").next().unwrap_or_default();
    let all = [
        (variants::<Effect>(), 18),
        (variants::<EntityCondition>(), 13),
        (variants::<Expression>(), 7),
        (variants::<StoryPosition>(), 6),
    ];
    for (names, least) in all {
        assert!(names.len() >= least, "{names:?}");
        for name in names {
            let is_named = [format!("`{name}`"), format!("`{name}(")];
            assert!(is_named.iter().any(|it| part.contains(it)), "{name}");
        }
    }
}
