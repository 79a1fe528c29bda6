//! Tests of XML as in real files: encodings, declarations, comments, document types, prefixes and entities.

use condyle_model::{Error, MjcfOptions, Model, SdfOptions, UrdfOptions};

/// Robot with one joint. The name of the joint contains a character that has different bytes in different encodings.
const ROBOT: &str = "<robot name='r'><link name='a'/><link name='b'/>
<joint name='Gelenk für b' type='continuous'><parent link='a'/><child link='b'/></joint></robot>";

fn urdf(text: &str) -> Result<Model, Error> {
    Model::from_urdf_str(text, &UrdfOptions::default())
}

/// Writes bytes to a file, and reads a URDF from this file.
fn file(name: &str, bytes: &[u8]) -> Result<Model, Error> {
    let path = std::env::temp_dir().join(format!("condyle-xml-{name}-{}.urdf", std::process::id()));
    std::fs::write(&path, bytes).unwrap();
    let model = Model::from_urdf(&path, &UrdfOptions::default());
    std::fs::remove_file(&path).unwrap();
    model
}

#[track_caller]
fn refused(text: &str, said: &str) {
    assert_eq!(urdf(text).unwrap_err().to_string(), format!("<string>:{said}"), "{text}");
}

/// Returns the bytes of a text in which each character is one byte (ISO-8859-1).
fn latin(text: &str) -> Vec<u8> {
    text.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect()
}

#[test]
fn encodings() {
    let joint = |model: Model| model.bodies()[1].joint_name.clone();
    let declare = |name: &str| format!("<?xml version='1.0' encoding='{name}'?>{ROBOT}");
    for name in ["ISO-8859-1", "iso-8859-1", "latin1", "windows-1252", "Windows-1252"] {
        assert_eq!(joint(file("latin", &latin(&declare(name))).unwrap()), "Gelenk für b", "{name}");
    }
    let euro =
        [&b"<?xml version=\"1.0\" encoding = \"windows-1252\" ?><robot name='\x80 \x9f'><link name='a'/></robot>"[..]];
    assert_eq!(file("euro", &euro.concat()).unwrap().name(), "€ Ÿ");
    for text in [ROBOT, &declare("UTF-8"), &declare("utf-16"), &format!("\u{feff}{ROBOT}"), &declare("us-ascii")] {
        assert_eq!(joint(file("utf8", text.as_bytes()).unwrap()), "Gelenk für b");
    }
    let units = |text: &str, unit: fn(u16) -> [u8; 2]| text.encode_utf16().flat_map(unit).collect::<Vec<u8>>();
    for text in [declare("UTF-16"), format!("\u{feff}{}", declare("UTF-16"))] {
        for (name, unit) in [("le", u16::to_le_bytes as fn(u16) -> [u8; 2]), ("be", u16::to_be_bytes)] {
            assert_eq!(joint(file(name, &units(&text, unit)).unwrap()), "Gelenk für b");
        }
    }
    // a string is already decoded, so its declared encoding is ignored
    assert_eq!(joint(urdf(&declare("ISO-8859-1")).unwrap()), "Gelenk für b");
}

/// Checks that an invalid byte has no effect in a comment, and that in a name it is an error with a line number.
#[test]
fn bytes_that_are_not_in_the_encoding() {
    let robot = latin(ROBOT);
    let comment = [b"<!-- \xe4 \x81 -->", ROBOT.as_bytes()].concat();
    assert!(file("comment", &comment).is_ok());
    let known = "expected UTF-8, UTF-16, US-ASCII, ISO-8859-1 or windows-1252";
    let said = file("bare", &robot).unwrap_err().to_string();
    let end = format!(".urdf:2: not well-formed XML: a byte is not UTF-8, and no encoding is declared: {known}");
    assert!(said.ends_with(&end), "{said}");
    let declared = [b"<!-- by hand -->\n<?xml version='1.0' encoding='Shift_JIS'?>".to_vec(), robot].concat();
    let said = file("unknown", &declared).unwrap_err().to_string();
    let end = format!(".urdf:3: not well-formed XML: a byte cannot be read in the encoding `Shift_JIS`: {known}");
    assert!(said.ends_with(&end), "{said}");
    let ascii = "<?xml version='1.0' encoding='Shift_JIS'?><robot name='r'><link name='a'/></robot>";
    assert!(file("ascii", ascii.as_bytes()).is_ok());
    let odd = [
        &b"\xff\xfe"[..],
        &"<robot name='r'><link name='a'/></robot>x".bytes().flat_map(|b| [b, 0]).collect::<Vec<_>>(),
    ];
    let odd = odd.concat();
    let said = file("odd", &odd[..odd.len() - 1]).unwrap_err().to_string();
    assert!(said.contains("text outside of the root element"), "{said}");
}

#[test]
fn prologs() {
    for prolog in [
        "\n\n",
        " \n<?xml version='1.0'?>",
        "<!-- first --><?xml version=\"1.0\"?>\n",
        "<!------ a ------>",
        "<!-- a -- b -->",
        "<!---->",
        "<?xml version='1.0'?><?pi?>",
        "<!DOCTYPE robot>",
        "<!DOCTYPE robot SYSTEM 'robot.dtd'>",
        "<!DOCTYPE robot [ <!ELEMENT robot (link)> <!-- ]> ' --> <!ENTITY a \"]>\"> ]>",
    ] {
        let model = urdf(&format!("{prolog}{ROBOT}<!-- end -->\n\0")).unwrap_or_else(|e| panic!("{prolog}: {e}"));
        assert_eq!(model.nv(), 1);
    }
    let mjcf = "<!DOCTYPE mujoco><mujoco><worldbody><body><joint/><geom size='1'/></body></worldbody></mujoco>";
    assert_eq!(Model::from_mjcf_str(mjcf, &MjcfOptions::default()).unwrap().nv(), 1);
}

/// Checks that lines are counted from the beginning of the file.
#[test]
fn lines() {
    let good = "<robot\nname='r'>\n<!--\n--><![CDATA[\n]]><link name='a'/><link name='b'/>\n<joint\n name='j'\n type='x'/></robot>";
    refused(good, "6: joint `j`: has no parent");
    refused(&good.replace('\n', "\r\n"), "6: joint `j`: has no parent");
    refused(
        &good.replace("<joint", "<joint name='j'"),
        "7: not well-formed XML: <joint> has a second attribute `name`",
    );
}

/// Checks that elements and attributes with the prefixes of other programs have no effect, whether the prefixes are
/// declared or not.
#[test]
fn prefixes() {
    let with = |inside: &str| ROBOT.replace("</robot>", &format!("{inside}</robot>"));
    let other = "<gz:joint name='k' gz:type='x'/><gazebo><sensor:camera name='c' a:b='1'/></gazebo>";
    let declared = with(other).replace("<robot ", "<robot xmlns='http://ros.org' xmlns:gz='http://gz' gz:made='1' ");
    for text in [with(other), declared] {
        let model = urdf(&text).unwrap();
        assert_eq!((model.nv(), model.warnings().iter().filter(|w| w.place().is_some()).count()), (1, 0));
    }
    let sdf = "<sdf version='1.9'><model name='m'><gz:note>x</gz:note><link name='a'/></model></sdf>";
    assert!(Model::from_sdf_str(sdf, &SdfOptions::default()).is_ok());
    // macros of xacro are recognized by the prefix `xacro`, declared or not, and by the namespace of another prefix
    let expand = "expand the file first (`xacro robot.urdf.xacro > robot.urdf`)";
    refused(&with("<xacro:wheel/>"), &format!("2: <xacro:wheel>: belongs to xacro: {expand}"));
    let renamed = with("<x:wheel name='w'/>").replace("<robot ", "<robot xmlns:x='http://www.ros.org/wiki/xacro' ");
    refused(&renamed, &format!("2: x:wheel `w`: belongs to xacro: {expand}"));
}

/// Checks that the text for other parsers has the same elements on the same lines as the original text.
#[test]
fn texts_for_other_parsers() {
    let text = "<!------ a -->\n<?xml version='1.0'?><!DOCTYPE robot><robot name='a&amp;&lt;&quot;'>\n<gz:a b:c='1'\n/>\n\
                <link name='b'>1 &lt; 2</link></robot>";
    let expected =
        "\n<robot name=\"a&amp;&lt;&quot;\">\n<gz-a b-c=\"1\"></gz-a>\n\n<link name=\"b\">1 &lt; 2</link></robot>";
    assert_eq!(Model::well_formed(text).unwrap(), expected);
    assert_eq!(Model::well_formed(expected).unwrap(), expected);
    assert!(Model::well_formed("<robot>").is_err());
}

#[test]
fn entities() {
    let name = |text: &str| urdf(&format!("<robot name='{text}'><link name='a'/></robot>")).unwrap().name().to_owned();
    for (written, read) in [
        ("&lt;&gt;&amp;&quot;&apos;", "<>&\"'"),
        ("&#65;&#x42;&#xe9;", "ABé"),
        ("a & b", "a & b"),
        ("a &amp;lt; b", "a &lt; b"),
        ("&;&&#;", "&;&&#;"),
        ("< >", "< >"),
    ] {
        assert_eq!(name(written), read, "{written}");
    }
    let refuse = |text: &str, said: &str| {
        refused(&format!("<robot name='{text}'/>"), &format!("1: not well-formed XML: {said}"));
    };
    refuse("&#0;", "`&#0;` is no character");
    refuse("&#xD800;", "`&#xD800;` is no character");
    refuse("&#99999999999;", "`&#99999999999;` is no character");
    let lol = "<!DOCTYPE r [<!ENTITY a \"aaaa\"><!ENTITY b \"&a;&a;&a;&a;\">]><robot name='&b;'/>";
    refused(lol, "1: not well-formed XML: entity `&b;` is not expanded: write its text instead");
    let signs = format!("<robot name='{}'><link name='a'/></robot>", "&".repeat(1 << 20));
    assert_eq!(urdf(&signs).unwrap().name().len(), 1 << 20); // each character is visited once
}

#[test]
fn texts_that_are_no_documents() {
    let refuse = |text: &str, said: &str| refused(text, &format!("1: not well-formed XML: {said}"));
    refuse("", "there is no element");
    refuse("<!-- a -->", "there is no element");
    refuse("robot", "text outside of the root element");
    refuse("<robot/>a", "text outside of the root element");
    refuse("<robot><link>", "<link> of line 1 is never closed");
    refuse("<robot><link></robot>", "</robot> where <link> of line 1 is open");
    refuse("</robot>", "</robot> closes nothing");
    refuse("<robot/><robot>", "<robot> of line 1 is never closed");
    refuse("<robot/><a></b>", "</b> where <a> of line 1 is open");
    refuse("<robot", "<robot> of line 1 is never closed");
    refuse("<robot name", "attribute `name` of <robot> has no value in quotation marks");
    refuse("<robot name=r>", "attribute `name` of <robot> has no value in quotation marks");
    refuse("<robot name='r", "attribute `name` of <robot> has a value without an end");
    refuse("<robot /a>", "`/` where a name is expected");
    refuse("<>", "`>` where a name is expected");
    refuse("<1/>", "`1` where a name is expected");
    refuse("<", "the end, where a name is expected");
    refuse("<!-- a", "a comment is never closed");
    refuse("<![CDATA[", "<![CDATA[ is never closed");
    refuse("<![CDATA[a]]>", "there is no element");
    refuse("<robot><![CDATA[ a", "<![CDATA[ is never closed");
    refuse("<? a", "<? is never closed");
    refuse("<!DOCTYPE [", "<! is never closed");
    refuse("</", "</ is never closed");
}

/// Checks that items outside of the root element cause a warning. MuJoCo 4.0.0 reads each of these texts, and uses only
/// the first root element (`mj_loadXML`).
#[test]
fn things_outside_of_the_root_element_warn() {
    let mujoco = "<mujoco><worldbody><body><joint/><geom size='1'/></body></worldbody></mujoco>";
    let text = "text outside of the root element has no effect";
    let end = "the text of the file ends before a tag that closes nothing: the rest has no effect";
    let second = "<mujoco> is a second root element, and has no effect";
    for (before, after, line, what) in [
        ("", "\n</mujoco>", 2, end),
        ("", "\n</a> no < xml", 2, end),
        ("?xml version='1.0'?>\n", "", 1, text),
        ("\n\na", "b<!-- -->", 3, text),
        ("", "<![CDATA[a]]>", 1, text),
        ("", &format!("\n{}", mujoco.replace('1', "2")), 2, second),
    ] {
        let model = Model::from_mjcf_str(&format!("{before}{mujoco}{after}"), &MjcfOptions::default());
        let model = model.unwrap_or_else(|e| panic!("{before} {after}: {e}"));
        assert_eq!((model.nv(), model.bodies().len()), (1, 2));
        let warnings: Vec<String> = model.warnings().iter().map(ToString::to_string).collect();
        assert_eq!(warnings, [format!("<string>:{line}: <mujoco>: {what}")]);
    }
    let robot = urdf(&format!("{ROBOT}</robot>")).unwrap();
    let said = format!("<string>:2: robot `r`: {end}");
    assert!(robot.warnings().iter().any(|warning| warning.to_string() == said), "{:?}", robot.warnings());
    let sdf = "?xml?><sdf version='1.7'><model name='m'><link name='a'/></model></sdf>";
    let model = Model::from_sdf_str(sdf, &SdfOptions::default()).unwrap();
    let said = format!("<string>:1: <sdf>: {text}");
    assert!(model.warnings().iter().any(|warning| warning.to_string() == said), "{:?}", model.warnings());
}

#[test]
fn names_that_begin_with_a_colon() {
    let plain = Model::well_formed("<robot><:a b:c='1' :d='2'/></robot>").unwrap();
    assert_eq!(plain, "<robot><_a b-c=\"1\" _d=\"2\"></_a></robot>");
    assert_eq!(Model::well_formed(&plain).unwrap(), plain);
}
