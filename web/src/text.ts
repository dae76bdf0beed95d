// Every English text of the pages. Another language is another object of the same type.

const number = (digits: number) => new Intl.NumberFormat("en", { minimumFractionDigits: digits, maximumFractionDigits: digits });
const formats = [0, 1, 2, 3].map(number);
const day = new Intl.DateTimeFormat("en", { day: "2-digit", month: "short", year: "numeric" });
const minute = new Intl.DateTimeFormat("en", { day: "2-digit", month: "short", year: "numeric", hour: "2-digit", minute: "2-digit", hourCycle: "h23" });

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
};

export const text = {
  product: "Arthron",
  loading: "Loading …",
  close: "Close",
  cancel: "Cancel",
  save: "Save",
  tryAgain: "Try again",
  skip: "Skip to content",
  navigation: "Main",
  notFound: { title: "There is no such page", hint: "The address may be old, or mistyped." },
  notAllowed: { title: "Not for this account", hint: "Your role does not include this page." },
  viewBroken: { title: "This page could not be shown", hint: "Reload it. If that does not help, the server's log may say more." },

  views: { wall: "Wall", sessions: "Sessions", admin: "Administration" },
  roles: { instructor: "Instructor", technician: "Technician", trainee: "Trainee" } as Record<string, string>,
  account: { menu: (name: string) => `Account ${name}`, signOut: "Sign out", theme: "Theme", system: "System", light: "Light", dark: "Dark" },

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
    noData: "No data from the server",
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
};
