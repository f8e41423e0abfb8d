// Steps a model and says where its site "tip" is: MODEL.xml SECONDS CONTROL...
#include <mujoco/mujoco.h>
#include <stdio.h>
#include <stdlib.h>

int main(int count, char **words) {
  char error[500] = "";
  mjModel *model = mj_loadXML(words[1], NULL, error, sizeof error);
  if (!model) return fprintf(stderr, "error: %s\n", error), 1;
  mjData *data = mj_makeData(model);
  for (int i = 0; i < model->nu && i + 3 < count; i++) data->ctrl[i] = atof(words[i + 3]);
  while (data->time < atof(words[2])) mj_step(model, data);
  const mjtNum *tip = data->site_xpos + 3 * mj_name2id(model, mjOBJ_SITE, "tip");
  return printf("%s %.17g %.17g %.17g\n", mj_versionString(), tip[0], tip[1], tip[2]) < 0;
}
