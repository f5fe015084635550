//! Paths of the files that editors name by URIs.

/// Returns the path of a `file:` URI, and any other URI as it is.
pub fn file_of_uri(uri: &str) -> String {
    let Some(place) = uri.strip_prefix("file://") else {
        return uri.to_owned();
    };
    // An authority such as `localhost` is before the path.
    let path = decoded(place.find('/').map_or(place, |slash| &place[slash..]));
    // `/c:/worlds` of Windows begins with its drive.
    let is_drive = path.as_bytes().get(2) == Some(&b':') && path.starts_with('/');
    if is_drive { path[1..].to_owned() } else { path }
}

/// Text with the bytes that `%` encodes.
fn decoded(text: &str) -> String {
    let bytes = text.as_bytes();
    let mut plain = Vec::with_capacity(bytes.len());
    let mut i = 0;
    while i < bytes.len() {
        let digits = text.get(i + 1..i + 3).filter(|_| bytes[i] == b'%');
        match digits.map(|it| u8::from_str_radix(it, 16)) {
            Some(Ok(byte)) => {
                plain.push(byte);
                i += 3;
            }
            _ => {
                plain.push(bytes[i]);
                i += 1;
            }
        }
    }
    String::from_utf8_lossy(&plain).into_owned()
}

#[cfg(test)]
mod tests {
    use super::file_of_uri;

    #[test]
    fn uris_of_files_are_paths() {
        let cases = [
            ("file:///a/b%20c.ron", "/a/b c.ron"),
            ("file:///c%3A/a.ron", "c:/a.ron"),
            ("file://localhost/a.ron", "/a.ron"),
            ("file:///a%C3%A9%zz%", "/aé%zz%"),
            ("untitled:Untitled-1", "untitled:Untitled-1"),
            ("file://", ""),
        ];
        for (uri, path) in cases {
            assert_eq!(file_of_uri(uri), path, "{uri}");
        }
    }
}
