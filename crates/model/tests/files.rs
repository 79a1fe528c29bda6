//! Tests of files that are large or deeply nested, and of paths that are not files. Each reader returns an error with
//! the number and the limit, or a model, and does not run for a long time.
//!
//! No test measures time. Without the limits, and without algorithms in linear time, these files would take between
//! half a minute and days.

use condyle_model::{Error, Joint, Mimic, MjcfOptions, Model, ModelBuilder, SdfOptions, Se3, UrdfOptions, Vec3, WORLD};
use condyle_model::{Inertia, Sym3};
use std::fs::File;
use std::path::{Path, PathBuf};

fn urdf(text: &str) -> Result<Model, Error> {
    Model::from_urdf_str(text, &UrdfOptions::default())
}

fn mjcf(text: &str) -> Result<Model, Error> {
    Model::from_mjcf_str(text, &MjcfOptions::default())
}

fn sdf(text: &str) -> Result<Model, Error> {
    Model::from_sdf_str(text, &SdfOptions::default())
}

#[track_caller]
fn refused(result: Result<Model, Error>, end: &str) {
    let said = result.expect_err(end).to_string();
    assert!(said.ends_with(end), "{said}\n{end}");
}

/// Returns a chain of links with joints of one kind, all on one line.
fn row(count: usize, kind: &str) -> String {
    let mut text = String::from("<robot name='row'><link name='0'/>");
    for i in 1..=count {
        text += &format!("<link name='{i}'/><joint name='{i}' type='{kind}'>");
        text += &format!("<parent link='{}'/><child link='{i}'/></joint>", i - 1);
    }
    text + "</robot>"
}

#[test]
fn fixed_links_on_one_line() {
    assert_eq!(urdf(&row(8000, "fixed")).unwrap().frames().len(), 16001);
}

#[test]
fn long_chains() {
    let limit = "degrees of freedom, at most 4096 are allowed in a model";
    refused(urdf(&row(5000, "continuous")), &format!("5000 {limit}"));
    refused(urdf(&row(800, "floating")), &format!("4800 {limit}"));
    let bodies = "<body><joint/></body>".repeat(5000);
    refused(mjcf(&format!("<mujoco><worldbody>{bodies}</worldbody></mujoco>")), &format!("5000 {limit}"));
    let mut sdf_row = String::from("<sdf version='1.7'><model name='m'>");
    for i in 0..5000 {
        sdf_row += &format!(
            "<link name='{i}'/><joint name='j{i}' type='ball'><parent>world</parent><child>{i}</child></joint>"
        );
    }
    refused(sdf(&(sdf_row + "</model></sdf>")), &format!("15000 {limit}"));

    let hinge = Joint::Revolute { axis: Vec3::new(0.0, 0.0, 1.0) };
    let ball = Inertia::from_com(1.0, Vec3::zero(), Sym3::diagonal(1.0));
    let row = |count: usize, mimic: bool| {
        let (mut builder, mut on) = (ModelBuilder::new("row"), WORLD);
        for i in 0..count {
            let before = on;
            on = builder.body(&i.to_string(), on, hinge, Se3::identity(), ball);
            if mimic && i == 1 {
                builder.mimic(on, before, Mimic { ratio: 1.0, offset: 0.0 });
            }
        }
        builder.build()
    };
    refused(row(5000, false), &format!("5000 {limit}"));
    refused(row(1200, true), "1199 coordinates, with joints that follow others, at most 1024 are allowed in a model");
    assert_eq!(row(4096, false).unwrap().nv(), 4096);
}

#[test]
fn deep_elements() {
    let nested = |root: &str, tag: &str, count: usize| {
        format!("<{root}>{}{}</{root}>", format!("<{tag}>").repeat(count), format!("</{tag}>").repeat(count))
    };
    let said = "elements are nested 100001 deep, at most 256 are allowed";
    for tag in ["link", "gazebo"] {
        refused(urdf(&nested("robot", tag, 100_000)), said);
    }
    for tag in ["default class='main'", "worldbody", "body", "frame", "include", "asset"] {
        let text = nested("mujoco", tag, 100_000).replace("</default class='main'>", "</default>");
        refused(mjcf(&text), said);
    }
    for tag in ["model", "world", "include", "link", "frame"] {
        refused(sdf(&nested("sdf", tag, 100_000)), said);
    }
    assert!(sdf(&nested("sdf", "model", 254)).is_err());
    let bodies = nested("mujoco", "body", 250).replace("<mujoco>", "<mujoco><worldbody>");
    assert!(mjcf(&bodies.replace("</mujoco>", "</worldbody></mujoco>")).is_ok());
}

#[test]
fn attributes_and_namespaces() {
    let many = |count: usize, name: &str| (0..count).map(|i| format!(" {name}{i}='{i}'")).collect::<String>();
    let wide = format!("<robot>\n<link name='a'{}/></robot>", many(100_000, "a"));
    refused(urdf(&wide), "the element on line 2 has 100001 attributes, at most 256 are allowed");
    let spaces = format!("<robot{}>{}</robot>", many(3000, "xmlns:a"), "<link name='a'/>".repeat(3000));
    refused(urdf(&spaces), "the element on line 1 has 3000 attributes, at most 256 are allowed");
    // declarations of prefixes are dropped, so they take no time
    let spaces: String = (0..100_000).map(|i| format!("<a xmlns:a{i}='a'/>")).collect();
    assert!(urdf(&format!("<robot>{spaces}<link name='a'/></robot>")).is_ok());
    // a comment may contain equals signs, and common files declare a dozen namespaces
    let comment = format!("<robot{}><!-- {} --><link name='a'/></robot>", many(12, "xmlns:a"), "=".repeat(100_000));
    assert!(urdf(&comment).is_ok());
}

#[test]
fn long_texts() {
    let end = "are allowed in the files of a robot";
    let mut large = format!("<robot><!--{}", " ".repeat(64 << 20));
    large += "--><link name='a'/></robot>";
    refused(urdf(&large), &format!("67108902 bytes, at most 67108864 {end}"));
    refused(
        mjcf(&format!("<mujoco>{}</mujoco>", "<a/>".repeat(1 << 20))),
        &format!("1048578 tags, at most 1048576 {end}"),
    );
    let signs = format!("<sdf><!--{}--></sdf>", "=".repeat((1 << 22) + 1));
    refused(sdf(&signs), &format!("4194305 equals signs, at most 4194304 {end}"));
}

/// Checks that unknown names are listed only up to a limit, because each unknown name is compared with all known names.
#[test]
fn unknown_names() {
    let tags = "<linkjoint linkjoint='1'/>".repeat(500_000);
    let model = urdf(&format!("<robot><link name='a'/>{tags}</robot>")).unwrap();
    assert_eq!(model.warnings().len(), 1001);
    let last = model.warnings()[1000].to_string();
    assert!(last.ends_with("more than 1000 names are unknown or left out: the rest is not listed"), "{last}");
}

/// Checks that the nearest name is found among long names and among many names.
#[test]
fn long_names() {
    let a = "a".repeat(100_000);
    let b = format!("b{a}");
    let joint =
        |child: &str| format!("<joint name='j' type='fixed'><parent link='base'/><child link='{child}'/></joint>");
    let base = "<robot><link name='base'/>";
    refused(urdf(&format!("{base}<link name='{a}'/>{}</robot>", joint(&b))), &format!("`{b}`; nearest is `{a}`"));
    let links: String = (0..100_000).map(|i| format!("<link name='{i}_{}'/>", &a[..100])).collect();
    refused(urdf(&format!("{base}{links}{}</robot>", joint("bas"))), "no link is named `bas`; nearest is `base`");
    let model = urdf(&format!("<robot><link name='{a}'/></robot>")).unwrap();
    assert!(matches!(model.frame(&b), Err(Error::UnknownFrame { nearest, .. }) if nearest == a));
}

/// Checks that a line break or tab in a name becomes a space, as in every XML attribute. A line break or tab given as a
/// character reference is kept.
#[test]
fn names_with_line_breaks() {
    for (written, read) in
        [("a\tb", "a b"), ("a\nb", "a b"), ("a\r\nb", "a b"), ("a&#10;b", "a\nb"), ("a&#9;b", "a\tb")]
    {
        let ends = format!("<parent link='base'/><child link='{written}'/><limit effort='1' velocity='1'/>");
        let joint = format!("<joint name='{written}' type='revolute'>{ends}</joint>");
        let model = urdf(&format!("<robot><link name='base'/><link name='{written}'/>{joint}</robot>")).unwrap();
        let body = &model.bodies()[1];
        assert_eq!((&*body.name, &*body.joint_name), (read, read), "{written:?}");
        assert!(model.frame(read).is_ok());
    }
}

/// Checks the time for chains of frames attached to frames, and of poses relative to poses: each element is visited
/// only once.
#[test]
fn attached_frames() {
    let row = |last: &str| {
        let mut text = String::from("<sdf version='1.8'><model name='m'><link name='l'/>");
        for i in 0..30_000 {
            text += &format!("<frame name='f{i}' attached_to='f{}'/>", i + 1);
        }
        text + &format!("<frame name='f30000' attached_to='{last}'/></model></sdf>")
    };
    assert_eq!(sdf(&row("l")).unwrap().frames().len(), 30_002);
    refused(sdf(&row("f7")), "its pose depends on itself");
    let own_pose = row("f7")
        .replace("'/>", "'><pose relative_to='l'/></frame>")
        .replace("<link name='l'><pose relative_to='l'/></frame>", "<link name='l'/>");
    refused(sdf(&own_pose), "is attached to itself");
}

/// Checks that the attributes that classes inherit are counted in the limit on attributes.
#[test]
fn default_classes() {
    let row: String = (0..250).map(|i| format!("<default class='c{i}'>")).collect();
    let deep = format!("<mujoco><default class='main'>{row}{}</default></mujoco>", "</default>".repeat(250));
    assert!(mjcf(&deep).is_ok());
    let geoms: String = (0..2000).map(|i| format!("<geom a{i}='1'/>")).collect();
    let wide: String = (0..2000).map(|i| format!("<default class='c{i}'/>")).collect();
    let said = "1050525 attributes of default classes so far, what they inherit included: at most 1048576 are allowed";
    refused(mjcf(&format!("<mujoco><default>{geoms}{wide}</default></mujoco>")), said);
}

/// Folder that is removed after its test.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("condyle-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        Self(folder)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Reads a file as URDF, as MJCF, as SDF, and as a file that an MJCF includes.
fn as_robots(path: &Path, folder: &Path) -> [Result<Model, Error>; 4] {
    let main = folder.join("main.xml");
    std::fs::write(&main, format!("<mujoco><include file='{}'/></mujoco>", path.display())).unwrap();
    [
        Model::from_urdf(path, &UrdfOptions::default()),
        Model::from_mjcf(path, &MjcfOptions::default()),
        Model::from_sdf(path, &SdfOptions::default()),
        Model::from_mjcf(main, &MjcfOptions::default()),
    ]
}

#[test]
fn large_files() {
    let folder = Folder::new("large");
    let path = folder.0.join("large.xml");
    File::create(&path).unwrap().set_len(10_000_000_000).unwrap(); // a sparse file, which takes no space on the disk
    for (k, result) in as_robots(&path, &folder.0).into_iter().enumerate() {
        let main = if k == 3 { std::fs::metadata(folder.0.join("main.xml")).unwrap().len() } else { 0 };
        let found = 10_000_000_000 + main;
        refused(result, &format!("{found} bytes, at most 67108864 are allowed in the files of a robot"));
    }
    let path = folder.0.join("text.xml");
    std::fs::write(&path, [b'<', 0xff]).unwrap();
    as_robots(&path, &folder.0).into_iter().for_each(|result| {
        let known = "expected UTF-8, UTF-16, US-ASCII, ISO-8859-1 or windows-1252";
        refused(result, &format!("a byte is not UTF-8, and no encoding is declared: {known}"));
    });
}

/// Checks that the limits apply to all files of one robot together.
#[test]
fn large_parts() {
    let folder = Folder::new("parts");
    let write = |name: &str, text: &str| std::fs::write(folder.0.join(name), text).unwrap();
    let comments = format!("<mujoco>{}</mujoco>", "<!---->".repeat(400_000));
    ["a.xml", "b.xml", "c.xml"].into_iter().for_each(|name| write(name, &comments));
    write("main.xml", "<mujoco><include file='a.xml'/><include file='b.xml'/><include file='c.xml'/></mujoco>");
    let read = || Model::from_mjcf(folder.0.join("main.xml"), &MjcfOptions::default());
    refused(read(), "1200011 tags, at most 1048576 are allowed in the files of a robot");
    // two different paths of the same file are recognized
    write("main.xml", "<mujoco><include file='a.xml'/><include file='./a.xml'/></mujoco>");
    refused(read(), "<include>: `./a.xml` is already part of the model");
    // the depth of an included file is added to the depth of its include
    let nested = |inside: &str| format!("<mujoco>{}{inside}{}</mujoco>", "<a>".repeat(200), "</a>".repeat(200));
    write("main.xml", &nested("<include file='a.xml'/>"));
    write("a.xml", &nested(""));
    refused(read(), "is at depth 257, files included: at most 256 are allowed");
}

#[cfg(unix)]
#[test]
fn no_files() {
    let folder = Folder::new("kinds");
    let pipe = folder.0.join("pipe");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let other = "expected a file, found a device, pipe or socket";
    for (path, said) in
        [(Path::new("/dev/zero"), other), (&pipe, other), (&folder.0, "expected a file, found a folder")]
    {
        for result in as_robots(path, &folder.0) {
            assert!(matches!(result, Err(Error::File { .. } | Error::Element { .. })));
            refused(result, said);
        }
    }
}
