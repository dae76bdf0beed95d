// #/today: what a trainee does next, to be read before a station is free.
import { useEffect } from "preact/hooks";
import type { View } from "../app";
import { Head, view } from "../kit";
import { Goals } from "../teach/limits_words";
import { Next } from "../teach/next";
import { text } from "../text";

export const today: View = view(({ app }) => {
  useEffect(() => app.title(text.views.today), []);
  return <>
    <Head title={text.views.today} hint={text.teach.todayHint} />
    <Next app={app} more={(_, task) => task && <><p>{task.briefing}</p><Goals task={task} /></>} />
  </>;
});
