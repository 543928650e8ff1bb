// Elements without markup: whatever a specification says stays text.

/** An element with properties, and children that are elements or texts. */
export function make(name, properties = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(properties)) {
    if (key in element && typeof value !== 'string') element[key] = value;
    else element.setAttribute(key, value);
  }
  element.append(...children.flat().filter((child) => child !== null));
  return element;
}

const MATH = 'http://www.w3.org/1998/Math/MathML';
const ELEMENTS = new Set(['mrow', 'mi', 'mn', 'mo', 'mfrac', 'msup', 'msub', 'msqrt', 'mroot', 'mspace']);

function tree(value) {
  if (typeof value === 'string') return document.createTextNode(value);
  const [name, ...children] = value;
  if (!ELEMENTS.has(name)) throw new Error(`no element of formulas: ${name}`);
  const element = document.createElementNS(MATH, name);
  if (name === 'mspace') element.setAttribute('width', '0.17em');
  element.append(...children.map(tree));
  return element;
}

/** A formula on a line of its own. */
export function formula(value) {
  const math = document.createElementNS(MATH, 'math');
  math.setAttribute('displaystyle', 'true');
  math.append(tree(value));
  return make('div', { class: 'formula', tabindex: '0' }, math);
}

const SVG = 'http://www.w3.org/2000/svg';

/** An element of a drawing. */
export function draw(name, attributes = {}, ...children) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...children);
  return element;
}
