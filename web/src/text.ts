// Every English text of the pages. Another language is another object of the same type.

const number = (digits: number) => new Intl.NumberFormat("en", { minimumFractionDigits: digits, maximumFractionDigits: digits });
const formats = [0, 1, 2, 3].map(number);
const day = new Intl.DateTimeFormat("en-GB", { day: "2-digit", month: "short", year: "numeric" });
const minute = new Intl.DateTimeFormat("en-GB", { day: "2-digit", month: "short", year: "numeric", hour: "2-digit", minute: "2-digit", hourCycle: "h23" });

const second = new Intl.DateTimeFormat("en-GB", { day: "2-digit", month: "short", year: "numeric", hour: "2-digit", minute: "2-digit", second: "2-digit", hourCycle: "h23" });

const two = (n: number): string => String(n).padStart(2, "0");
const count = (n: number, one: string, many = `${one}s`): string => `${n} ${n === 1 ? one : many}`;

export const format = {
  none: "–",
  /** With a fixed number of digits, so that columns stand still; a dash for what is not known. */
  number: (value: number | undefined, digits = 0): string => (value === undefined || !Number.isFinite(value) ? "–" : formats[digits]!.format(value)),
  percent: (share: number | undefined, digits = 1): string => (share === undefined || !Number.isFinite(share) ? "–" : `${formats[digits]!.format(share * 100)} %`),
  /** 4:07, 1:02:33. */
  clock: (seconds: number): string => {
    const s = Math.max(0, Math.floor(seconds));
    const h = Math.floor(s / 3600);
    return h ? `${h}:${two(Math.floor(s / 60) % 60)}:${two(s % 60)}` : `${Math.floor(s / 60)}:${two(s % 60)}`;
  },
  /** How long ago, short: 8 s, 3 min, 2 h, 4 d. */
  ago: (ms: number): string => {
    const s = Math.max(0, Math.floor(ms / 1000));
    if (s < 120) return `${s} s`;
    if (s < 7200) return `${Math.floor(s / 60)} min`;
    return s < 172800 ? `${Math.floor(s / 3600)} h` : `${Math.floor(s / 86400)} d`;
  },
  date: (utcMs: number): string => day.format(utcMs),
  time: (utcMs: number): string => minute.format(utcMs),
  second: (utcMs: number): string => second.format(utcMs),
};

export const text = {
  product: "Arthron",
  loading: "Loading …",
  close: "Close",
  cancel: "Cancel",
  save: "Save",
  done: "Done",
  copy: "Copy",
  copied: "Copied",
  copyYourself: "The browser does not allow copying: select the text.",
  reload: "Reload",
  listBroken: "This could not be read",
  tryAgain: "Try again",
  skip: "Skip to content",
  navigation: "Main",
  notFound: { title: "There is no such page", hint: "The address may be old, or mistyped." },
  notAllowed: { title: "Not for this account", hint: "Your role does not include this page." },
  viewBroken: { title: "This page could not be shown", hint: "Reload it. If that does not help, the server's log may say more." },

  views: { wall: "Wall", sessions: "Sessions", admin: "Administration" },
  roles: { instructor: "Instructor", technician: "Technician", trainee: "Trainee" } as Record<string, string>,
  account: { menu: (name: string) => `Account ${name}`, signOut: "Sign out", password: "Change password", current: "Password now", fresh: "New password", changed: "Sign in with the new password.", theme: "Theme", system: "System", light: "Light", dark: "Dark" },

  link: {
    connecting: "Connecting …",
    open: "Live",
    quiet: (ms: number) => `No data for ${format.ago(ms)}`,
    broken: (ms: number) => `Connection lost ${format.ago(ms)} ago`,
    retry: (ms: number) => (ms > 0 ? `Trying again in ${Math.ceil(ms / 1000)} s` : "Trying again …"),
  },

  errors: {
    unreachable: "The server does not answer. Check the network, then try again.",
    noAnswer: "The server has not answered. It is not known whether this was done.",
    notSent: "Not connected to the server: nothing was sent.",
    status: (status: number) => `The server refused this (${status}).`,
    codes: {
      wrong_password: () => "Name and password do not match.",
      wrong_code: () => "This code is wrong, or has expired.",
      too_many: (s) => `Too many wrong attempts. Try again in ${count(Math.max(1, s), "second")}.`,
    } as Record<string, (retryAfterS: number) => string>,
  },

  signIn: {
    title: "Sign in",
    password: "With a password",
    code: "With a code",
    name: "Name",
    secret: "Password",
    codeLabel: "Sign-in code",
    codeHint: "8 characters, from your instructor",
    submit: "Sign in",
    needName: "Enter your name.",
    needPassword: "Enter your password.",
    needCode: "Enter the 8 characters of your code.",
  },
  first: {
    title: "Welcome to Arthron",
    hint: "This server has no instructor yet. The account that you make here can do everything, making other accounts included.",
    name: "Name",
    nameHint: "Letters, digits, dot, dash",
    password: "Password",
    passwordHint: "At least 10 characters",
    again: "Password again",
    submit: "Make account",
    different: "The two passwords differ.",
    short: "At least 10 characters.",
    needName: "Enter a name.",
  },

  wall: {
    stations: "Stations",
    waiting: "Waiting for the stations …",
    unreachable: "The server does not answer",
    unreachableHint: "The wall comes back by itself as soon as it does.",
    nobody: "No trainee",
    summary: (n: { running: number; paused: number; waiting: number; gone: number }) =>
      `${n.running} running · ${n.paused} paused · ${n.waiting} waiting · ${n.gone} not connected`,
    standings: { waiting: "Waiting", running: "Running", paused: "Paused", closed: "Closed", gone: "Not connected" },
    urgencies: ["", "Look", "Act", "Now"],
    attention: "Attention",
    allQuiet: "Nothing needs you",
    noData: "Nothing is heard of it",
    server: "Server",
    serverQuiet: "No data: all that is shown is old",
    oldFor: (ms: number) => `No data for ${format.ago(ms)}`,
    roundTrip: "Round trip", loss: "Frames lost", clock: "Clock",
    rate: "Slowest device", dropouts: "Dropouts", lost: "Devices lost",
    cuts: "Cuts", removed: "Removed", displacement: "Discrepancy",
    dropoutsUnit: "gaps",
    cutsUnit: (n: number) => (n === 1 ? "cut" : "cuts"),
    key: "On a small card",
    keys: ["Cuts", "", "Discrepancy", "Round trip", "Loss", "Clock (ms)", "Rate", "Gaps", "Lost/all"],
    spoken: (station: string, trainee: string, caseName: string, standing: string, warning: string) =>
      [station, trainee, caseName, standing, warning].filter((part) => part !== "").join(", "),
  },

  sessions: {
    none: "No sessions yet",
    noneHint: "A session appears here as soon as a station has begun one.",
    noneFound: "No sessions match",
    noneFoundHint: "No recorded session has this trainee, course and case.",
    clear: "Clear filters",
    filters: { trainee: "Trainee", course: "Course", case: "Case" },
    all: { trainee: "All trainees", course: "All courses", case: "All cases" },
    pick: "Choose", choose: (when: string) => `Choose the session of ${when}`,
    chooseOther: "Choose one more to compare.", chooseTwo: "Choose two to compare.",
    start: "Start", trainee: "Trainee", case: "Case", station: "Station", length: "Length", state: "State", missing: "Steps missing", actions: "Actions",
    nobody: "nobody",
    states: { open: "Running", closed: "Closed", deserted: "Deserted", interrupted: "Interrupted" } as Record<string, string>,
    kinds: { open: "good", deserted: "look", interrupted: "act" } as Record<string, string>,
    report: "Report", trace: "Trace",
    compare: "Compare", newest: "Newest", older: "Older",
  },

  admin: {
    parts: { stations: "Stations", cases: "Cases", trainees: "Trainees", courses: "Courses", accounts: "Accounts", tokens: "Tokens", audit: "Audit log" },
    stations: {
      hint: "Those of the server's config. A station needs a certificate, which it gets with a one-time code.",
      none: "No stations", noneHint: "The server's config names them: [station NAME].",
      name: "Station", case: "Case", trainee: "Trainee", start: "Sessions start", certificate: "Certificate", actions: "Actions",
      starts: { auto: "By themselves", command: "On command" } as Record<string, string>,
      enrolled: "Enrolled", notEnrolled: "Not enrolled", until: (date: string) => `Until ${date}`, expired: (date: string) => `Expired ${date}`,
      code: "One-time code", revoke: "Revoke",
      codeTitle: (name: string) => `Code for ${name}`,
      codeHint: (until: string) => `Works once, until ${until}. Type it at the station: arthron-station enrol`,
      revokeTitle: (name: string) => `Revoke ${name}?`,
      revokeHint: "Its certificates and codes end at once; a running session loses its station. It can be enrolled again.",
      revoked: (name: string) => `${name} is revoked`,
    },
    cases: {
      hint: "What the server has, and what checking each found.",
      none: "No cases", noneHint: "The server's config names the folders that they are in.",
      name: "Case", title: "Title", groups: "Surfaces", cuttable: "Can be cut", grade: "Grade", hash: "Hash", actions: "Actions",
      grades: { fit: "Fit", "fit with warnings": "Fit with warnings", unfit: "Unfit", unchecked: "Unchecked", outdated: "Outdated", broken: "Broken" } as Record<string, string>,
      report: "Check report", reportOf: (name: string) => `Check report of ${name}`,
      unchecked: "arthron-case check writes a report into its folder.",
      checked: "Checked", quick: "(quick)", folds: "Space that folds", gain: "Gain, 99.9 %", gainMost: "Largest gain", jumps: "Jumps",
      findings: "Findings", level: "Level", where: "Where", finding: "Finding",
      levels: { fault: "Fault", error: "Fault", warning: "Warning", note: "Note" } as Record<string, string>,
    },
    trainees: {
      hint: "A trainee signs in with a code, which works for 12 hours, and sees only own sessions.",
      none: "No trainees", noneHint: "Add one, or name one in a station's config.",
      name: "Name", nameHint: "Short, as in the stations' config; stays the same", fullName: "Full name", fullNameHint: "May be left out",
      sessions: "Sessions", created: "Since", actions: "Actions",
      add: "Add trainee", added: (name: string) => `${name} is added`,
      code: "Sign-in code", codeTitle: (name: string) => `Sign-in code for ${name}`,
      codeHint: (until: string) => `Works until ${until}. An earlier code of this trainee is void.`,
    },
    courses: {
      hint: "Who trains together: figures are compared within a course.",
      none: "No courses", noneHint: "Add one, then choose who is in it.",
      name: "Course", nameHint: "Such as autumn-2026", trainees: "Trainees", created: "Since", actions: "Actions",
      add: "Add course", people: "Trainees", peopleOf: (name: string) => `Trainees of ${name}`, sessions: "Sessions",
      nobody: "Nobody is in this course", choose: "Choose a trainee", enter: "Add to course",
    },
    accounts: {
      hint: "Who can sign in with a password.",
      none: "No accounts",
      name: "Name", role: "Role", trainee: "Trainee", signIn: "Can sign in", created: "Since", actions: "Actions", can: "Yes", cannot: "No",
      chooseTrainee: "Choose a trainee", traineeHint: "Whose sessions this account sees",
      password: "Password", passwordHint: "At least 10 characters", newPassword: "New password", keepHint: "Left empty, it stays as it is",
      add: "Add account", added: (name: string) => `${name} is added`,
      change: "Change", changeTitle: (name: string) => `Change ${name}`, changeHint: "The account is signed out everywhere.", changed: (name: string) => `${name} is changed`,
      remove: "Delete", removeTitle: (name: string) => `Delete ${name}?`, removeHint: "The account is signed out at once and cannot sign in again. What it did stays in the audit log.",
    },
    tokens: {
      hint: "What you are signed in by: browsers, and tokens of programs of yours.",
      none: "No tokens",
      kind: "Kind", kinds: { cookie: "Browser", token: "Program" }, name: "Name", nameHint: "What it is for, such as nightly export",
      current: "This browser", created: "Made", used: "Last used", until: "Until", actions: "Actions",
      add: "Add token", codeTitle: (name: string) => `Token ${name}`, codeHint: (until: string) => `Shown only now. It can do all that you can, until ${until}: keep it like a password.`,
      remove: "Remove", removeTitle: "Remove this?", removeHint: "Who uses it is signed out at once.",
    },
    audit: {
      hint: "Who did what. It can be added to, not changed.",
      none: "Nothing yet",
      howMany: "How many", last: (n: number) => `Last ${formats[0]!.format(n)}`,
      time: "Time", actor: "Who", action: "What", subject: "To what",
    },
  },
};
