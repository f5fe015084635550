//! Style sheet of SVG files, for programs that know no CSS variables.
//!
//! Browsers read the style of a page as it is. librsvg and Inkscape know neither
//! `var()` nor `@container`, and draw shapes without a colour in black. The style of a
//! file therefore has every colour as a value. Inkscape also finds no shape by its
//! place in the root, so selectors do not name it. The dark colours follow in a media
//! query, which such programs skip.

/// Beginning of a media query for dark themes, as the style of the page writes it.
const DARK: &str = "@media (prefers-color-scheme: dark)";

/// Returns the style of a file: the given sheets without variables.
///
/// The first sheet declares the variables: one rule `:root`, and a dark one in a
/// media query. Other at-rules are dropped, because they lay out pages.
pub(super) fn file_style(sheets: &[&str]) -> String {
    let mut light = Vec::new();
    let mut dark = Vec::new();
    let mut rules = Vec::new();
    for (selector, body) in sheets.iter().flat_map(|sheet| blocks(sheet)) {
        match selector {
            ":root" => light = variables(body),
            DARK => {
                dark = blocks(body)
                    .first()
                    .map_or(Vec::new(), |it| variables(it.1))
            }
            at if at.starts_with('@') => {}
            _ => rules.push((within_file(selector), body)),
        }
    }
    let plain = rules
        .iter()
        .map(|(selector, body)| format!("{selector}{{{}}}", resolved(body, &light)));
    // Only the colours differ, so the dark rules repeat nothing else.
    let themed = rules.iter().filter_map(|(selector, body)| {
        let themed = body
            .split(';')
            .filter(|it| it.contains("var("))
            .collect::<Vec<_>>()
            .join(";");
        (!themed.is_empty()).then(|| format!("{selector}{{{}}}", resolved(&themed, &dark)))
    });
    let (plain, themed): (String, String) = (plain.collect(), themed.collect());
    format!("{plain}{DARK}{{{themed}}}")
}

/// Returns a selector that needs no `svg` around its shapes.
///
/// A file has nothing else, and Inkscape does not find its root by a selector.
fn within_file(selector: &str) -> String {
    let parts = selector
        .split(',')
        .map(str::trim)
        .map(|it| it.strip_prefix("svg ").unwrap_or(it).trim_start());
    parts.collect::<Vec<_>>().join(", ")
}

/// Returns the blocks of a sheet: text before the braces, and text within them.
fn blocks(sheet: &str) -> Vec<(&str, &str)> {
    let mut blocks = Vec::new();
    let (mut depth, mut from, mut open) = (0, 0, 0);
    for (at, letter) in sheet.char_indices() {
        match letter {
            '{' => {
                if depth == 0 {
                    open = at;
                }
                // Depth counts, since rules are nested in media queries.
                depth += 1;
            }
            '}' => {
                depth -= 1;
                if depth == 0 {
                    blocks.push((sheet[from..open].trim(), sheet[open + 1..at].trim()));
                    from = at + 1;
                }
            }
            _ => {}
        }
    }
    blocks
}

/// Returns the variables of a rule by name, such as `--ink`.
fn variables(body: &str) -> Vec<(&str, &str)> {
    let declarations = body.split(';').filter_map(|it| it.split_once(':'));
    declarations
        .map(|(name, value)| (name.trim(), value.trim()))
        .filter(|(name, _)| name.starts_with("--"))
        .collect()
}

/// Replaces every `var(--name)` by its value.
fn resolved(body: &str, variables: &[(&str, &str)]) -> String {
    // Values have no variables themselves, so one pass is enough.
    let replaced =
        |text: String, (name, value): &(&str, &str)| text.replace(&format!("var({name})"), value);
    variables.iter().fold(body.trim().to_owned(), replaced)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_variable_of_a_sheet_becomes_a_value_in_both_themes() {
        let first = ":root { color-scheme: light dark; --ink: #111; --line: #222; } \
            @media (prefers-color-scheme: dark) { :root { --ink: #eee; --line: #ddd; } } \
            text { fill: var(--ink); font-size: 3px; }";
        let second = ".a { stroke: var(--line) } @container (max-width: 7px) { .a { x: 1; } }";
        assert_eq!(
            file_style(&[first, second]),
            "text{fill: #111; font-size: 3px;}.a{stroke: #222}\
             @media (prefers-color-scheme: dark){text{fill: #eee}.a{stroke: #ddd}}"
        );
    }

    #[test]
    fn shapes_of_a_file_are_found_without_its_root() {
        let sheet = ":root { --ink: #111; } @media (prefers-color-scheme: dark) { :root { --ink: #eee; } } \
            svg { font: 9px sans-serif; } svg .tick, svg .word { fill: var(--ink); } svg text.bad { x: 1; } .svg rect { y: 2; }";
        assert_eq!(
            file_style(&[sheet]),
            "svg{font: 9px sans-serif;}.tick, .word{fill: #111;}text.bad{x: 1;}.svg rect{y: 2;}\
             @media (prefers-color-scheme: dark){.tick, .word{fill: #eee}}"
        );
    }

    #[test]
    fn the_sheets_of_files_have_no_variable_left() {
        let sheets = [crate::report::page::STYLE, crate::report::animation::SHAPES];
        let style = file_style(&sheets);
        assert!(style.contains(".paint{fill: currentColor"), "{style}");
        for forbidden in ["var(", "--", "@container", ":root", "svg ."] {
            assert!(!style.contains(forbidden), "{forbidden} in {style}");
        }
    }
}
